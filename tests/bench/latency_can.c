/* SPDX-License-Identifier: MIT
 * latency_can.c - six CiA 402 drives on a CAN interface: those of tests/support, whose bus in memory one more node joins to the
 * interface.
 */
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "canopen_drives.h"
#include "latency_drives.h"

#define SYNC       0x080u
#define RPDO       0x200u /* and a node: controlword, target */
#define RPDO_BYTES 6u
#define START      200000000 /* 200 mm: half the stroke of config/hexapod-cia402.ini */
#define LOOK_MS    5         /* drives do things by themselves */
#define RETRIES    1000u
#define RETRY_NS   100000

static struct {
    int link;
    sim_can_bus_t bus;
    sim_can_t gate; /* on which what comes from the interface enters, and what drives say leaves */
    canopen_drives_t twin;
    uint8_t target[DRIVES][RPDO_BYTES - 2];
    pthread_t thread;
} s_can;

static void send_frame(const can_frame_t *frame)
{
    struct can_frame out = {.can_id = frame->id, .can_dlc = frame->length};
    memcpy(out.data, frame->data, frame->length);
    for (unsigned i = 0; i < RETRIES && write(s_can.link, &out, sizeof out) != (ssize_t)sizeof out; i++) {
        (void)nanosleep(&(struct timespec){.tv_nsec = RETRY_NS}, NULL); /* no room: a bus of finite speed */
    }
}

static void let_drives_work(void)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    canopen_drives_step(&s_can.twin, wall_ns() / 1000u);
    while (hal_can_recv(sim_can_hal(&s_can.gate), &frame, &at_us) == HV_OK) {
        if (!frame.is_error) {
            send_frame(&frame);
        }
    }
}

static void look_at(const struct can_frame *frame, uint64_t arrived_ns)
{
    const unsigned drive = frame->can_id - RPDO - 1u;
    if (frame->can_id == SYNC) {
        note_sync(arrived_ns);
    } else if (drive < DRIVES && frame->can_dlc == RPDO_BYTES) {
        if (memcmp(s_can.target[drive], frame->data + 2, sizeof s_can.target[drive]) != 0) {
            note_other(drive, arrived_ns);
        }
        memcpy(s_can.target[drive], frame->data + 2, sizeof s_can.target[drive]);
    }
}

static void take(const struct can_frame *frame, uint64_t arrived_ns)
{
    can_frame_t in = {.id = frame->can_id, .length = frame->can_dlc};
    if ((frame->can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) != 0) {
        return;
    }
    look_at(frame, arrived_ns);
    memcpy(in.data, frame->data, sizeof in.data);
    (void)!hal_can_send(sim_can_hal(&s_can.gate), &in);
}

/* Whatever waits, before drives judge how long they have heard nothing. */
static void take_all(void)
{
    struct can_frame frame;
    char control[STAMP_MAX];
    struct iovec part = {&frame, sizeof frame};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    for (unsigned i = 0; i < SIM_CAN_RX_FRAMES; i++) {
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        if (recvmsg(s_can.link, &message, MSG_DONTWAIT) != (ssize_t)sizeof frame) {
            return;
        }
        take(&frame, stamp_of(&message));
        sim_can_bus_step(&s_can.bus, wall_ns() / 1000u);
    }
}

static void *serve(void *argument)
{
    (void)argument;
    (void)be_urgent(URGENT);
    for (;;) {
        (void)poll(&(struct pollfd){.fd = s_can.link, .events = POLLIN}, 1, LOOK_MS);
        take_all();
        let_drives_work();
    }
    return NULL;
}

static void open_link(const char *interface)
{
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    s_can.link = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    if (s_can.link < 0) {
        fail("this kernel has no SocketCAN");
    }
    if (address.can_ifindex == 0 || bind(s_can.link, (const struct sockaddr *)&address, sizeof address) != 0) {
        fail("no such CAN interface");
    }
    ask_for_stamps(s_can.link);
}

void start_can(const char *interface)
{
    open_link(interface);
    sim_can_bus_init(&s_can.bus, 0, NULL, 0);
    canopen_drives_open(&s_can.twin, &s_can.bus);
    if (sim_can_open(&s_can.gate, &s_can.bus, NULL, 0) != HV_OK) {
        fail("no bus");
    }
    const uint64_t now_us = wall_ns() / 1000u;
    s_can.twin.now_us = now_us; /* which it was at no time before */
    for (unsigned k = 0; k < CANOPEN_DRIVES; k++) {
        canopen_drives_power(&s_can.twin, k, k < DRIVES);
        canopen_drives_place(&s_can.twin, k, START);
        s_can.twin.drive[k].node.drive.jump_counts = INT32_MAX;
    }
    if (pthread_create(&s_can.thread, NULL, serve, NULL) != 0) {
        fail("no thread");
    }
}

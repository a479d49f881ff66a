/* SPDX-License-Identifier: MIT
 * doctor.c - heaved --doctor; see doctor.h.
 */
#include "inspect/doctor.h"

#include <errno.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "common/clock_trust.h"
#include "common/sentence.h"
#include "common/socket_path.h"
#include "common/translate.h"
#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/modbus_section.h"
#include "inspect/doctor_judge.h"
#include "inspect/doctor_modbus.h"
#include "inspect/doctor_probe.h"
#include "linux_udp.h"

#define LISTEN_MS 500u
#define RAW_MS    500u
#define CALL_MS   1000u /* some drives take 700 ms for 1000h */

/* --- The machine --- */

static bool is_daemon_running(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return false;
    }
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const bool is_taken = connect(fd, (const struct sockaddr *)&address, sizeof address) == 0;
    (void)close(fd);
    return is_taken;
}

/* Tries out whether real-time priority and memory lock are permitted, and undoes both. */
static doctor_host_t look_at_host(const config_t *config)
{
    doctor_host_t host = {.is_clock_trusted = clock_is_trusted(&clock_trust_files),
                          .is_date_of_matter = config->selftest.when == CONFIG_SELFTEST_DAILY};
    struct utsname name;
    const struct sched_param first_in = {.sched_priority = 1};
    const struct sched_param usual = {.sched_priority = 0};
    if (uname(&name) == 0) {
        char *rest = name.release;
        host.kernel_major = (unsigned)strtoul(rest, &rest, 10);
        host.kernel_minor = *rest == '.' ? (unsigned)strtoul(rest + 1, NULL, 10) : 0;
    }
    host.is_realtime_allowed = sched_setscheduler(0, SCHED_FIFO, &first_in) == 0;
    (void)sched_setscheduler(0, SCHED_OTHER, &usual);
    host.is_memory_lock_allowed = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    (void)munlockall();
    return host;
}

static void check_port(doctor_report_t *report, const config_udp_t *udp)
{
    linux_udp_t socket;
    char shown[SENTENCE_MAX];
    const linux_udp_config_t config = {.bind = udp->bind, .group = udp->group, .port = udp->port};
    if (linux_udp_open(&socket, &config) == HV_OK) {
        doctor_say(report, DOCTOR_OK, "UDP port %u is free", udp->port);
        linux_udp_close(&socket);
        return;
    }
    doctor_say(report, DOCTOR_FAIL, "%s -> %s", sentence(socket.error_text, shown, sizeof shown),
               socket.error == EADDRINUSE ? _("end the program that `ss -ulpn` shows, or another [udp] port")
                                          : _("[udp] bind, port and group"));
}

/* --- The bus --- */

/* What the system knows of the interface. True where it can be used. */
static bool check_interface(doctor_report_t *report, const config_can_t *can, const doctor_host_t *host)
{
    linux_can_link_t link;
    struct mnl_socket *netlink = linux_can_link_open();
    if (netlink == NULL) {
        doctor_say(report, DOCTOR_FAIL, "the system does not tell about interfaces: %s -> not in a sandbox without AF_NETLINK",
                   error_text(errno));
        return false;
    }
    const hv_status_t status = linux_can_link_look(netlink, can->interface, &link);
    const int error = errno;
    linux_can_link_close(netlink);
    if (status == HV_OK) {
        return doctor_judge_link(report, can, &link, host);
    }
    if (status == HV_ERR_AGAIN) {
        doctor_say(report, DOCTOR_FAIL,
                   "there is no interface %s -> plug it in, or [can] interface: see `ip -br link show type can`", can->interface);
    } else {
        doctor_say(report, DOCTOR_FAIL, "%s: %s -> docs/can.md", can->interface, error_text(error));
    }
    return false;
}

static void check_strangers(doctor_report_t *report, doctor_probe_t *probe, const cia402_config_t *drives)
{
    doctor_probe_call(probe, CALL_MS);
    for (unsigned node = 1; node < DOCTOR_NODES; node++) {
        bool is_ours = false;
        for (unsigned k = 0; k < drives->axes; k++) {
            is_ours |= drives->axis[k].node == node;
        }
        if (!is_ours && doctor_probe_is_there(probe, node)) {
            doctor_say(report, DOCTOR_WARN, "node %u is on the bus and not in [cia402] nodes -> add it, or leave it", node);
        }
    }
    if (probe->is_synced) {
        doctor_say(report, DOCTOR_FAIL, "somebody sends SYNC: there is another master on the bus -> end it");
    }
}

static void check_cia402(doctor_report_t *report, const config_t *config, doctor_probe_t *probe)
{
    static cia402_config_t drives;
    static doctor_node_t node[DRIVES_MAX];
    char shown[SENTENCE_MAX];
    config_cia402(config, &drives);
    doctor_probe_listen(probe, LISTEN_MS);
    for (unsigned k = 0; k < drives.axes; k++) {
        doctor_probe_node(probe, &drives.axis[k], drives.sdo_timeout_ms, &node[k]);
        if (doctor_judge_wire(report, &config->can, doctor_probe_wire(probe))) {
            return;
        }
        doctor_judge_node(report, &drives, k, &node[k]);
        if (doctor_probe_trouble(probe) != NULL) {
            doctor_say(report, DOCTOR_FAIL, "%s -> docs/can.md", sentence(doctor_probe_trouble(probe), shown, sizeof shown));
            return;
        }
    }
    check_strangers(report, probe, &drives);
    doctor_write_inventory(report->out, &drives, node);
}

static void check_can_raw(doctor_report_t *report, const config_t *config, doctor_probe_t *probe)
{
    static canraw_map_t map;
    bool is_heard[DRIVES_MAX];
    config_canraw_map(config, &map);
    doctor_probe_raw(probe, &map, RAW_MS, is_heard);
    if (doctor_judge_wire(report, &config->can, doctor_probe_wire(probe))) {
        return;
    }
    for (unsigned k = 0; k < map.axes; k++) {
        if (is_heard[k]) {
            doctor_say(report, DOCTOR_OK, "drive %u answers with identifier %Xh", k + 1u, (unsigned)map.axis[k].reply_id);
        } else {
            doctor_say(report, DOCTOR_FAIL,
                       "drive %u: nothing with identifier %Xh -> its supply, cable and bit rate; [can-raw] reply_id and "
                       "position_query",
                       k + 1u, (unsigned)map.axis[k].reply_id);
        }
    }
}

static void check_bus(doctor_report_t *report, const config_t *config, const doctor_host_t *host)
{
    static doctor_probe_t probe;
    char shown[SENTENCE_MAX];
    const bool is_local = linux_can_local_is(config->can.interface);
    if (is_local) {
        doctor_say(report, DOCTOR_WARN,
                   "%s is a bus between programs, for heave-twin -> for real drives [can] interface has to be a CAN interface",
                   config->can.interface);
    } else if (!check_interface(report, &config->can, host)) {
        doctor_say(report, DOCTOR_WARN, "the drives have not been asked -> the interface first, then --doctor again");
        return;
    }
    if (!doctor_probe_open(&probe, config->can.interface)) {
        doctor_say(report, DOCTOR_FAIL, "%s -> %s",
                   doctor_probe_trouble(&probe) != NULL ? sentence(doctor_probe_trouble(&probe), shown, sizeof shown) : "?",
                   is_local ? "docs/twin.md" : "docs/can.md");
        return;
    }
    if (config->drives == CONFIG_DRIVES_CIA402) {
        check_cia402(report, config, &probe);
    } else {
        check_can_raw(report, config, &probe);
    }
    doctor_probe_close(&probe);
}

/* Where the service that has this file listens, if it may have the default: called by hand, the doctor has no directory of it. */
static bool is_service(char path[SOCKET_PATH_MAX], const config_t *config, const char *file)
{
    const char *slash = strrchr(file, '/');
    const char *name = slash != NULL ? slash + 1 : file;
    const char *dot = strrchr(name, '.');
    char platform[SOCKET_PATH_MAX];
    const int length = (int)(dot != NULL ? (size_t)(dot - name) : strlen(name));
    return strcmp(config->control_socket, SOCKET_DEFAULT) == 0 &&
           snprintf(platform, sizeof platform, "%.*s", length, name) < (int)sizeof platform &&
           socket_path_of_platform(path, SOCKET_DIRECTORY, platform);
}

bool doctor_run(const config_t *config, const char *file, FILE *out)
{
    doctor_report_t report = {.out = out};
    char of_service[SOCKET_PATH_MAX];
    const bool is_asked = is_service(of_service, config, file) && is_daemon_running(of_service);
    const char *path = is_asked ? of_service : config->control_socket;
    if (is_asked || is_daemon_running(path)) {
        doctor_say(&report, DOCTOR_FAIL, "heaved is running (%s): the drives are its own -> heavectl status; or stop it first",
                   path);
        return false;
    }
    const doctor_host_t host = look_at_host(config);
    doctor_judge_host(&report, &host);
    check_port(&report, &config->udp);
    if (config->drives == CONFIG_DRIVES_SIM) {
        doctor_say(&report, DOCTOR_OK, "drives are simulated: there is no bus to look at");
    } else if (config_modbus_is_used(config)) {
        doctor_modbus_check(&report, config);
    } else {
        check_bus(&report, config, &host);
    }
    doctor_sum(&report);
    return report.count[DOCTOR_FAIL] == 0;
}

/* SPDX-License-Identifier: MIT
 * fault_help.c - what programs and people are told about machine faults beyond a line of log; see fault.h. Apart from fault.c,
 * so that firmware which shows none of it does not carry it.
 */
#include "heave/fault.h"

/* clang-format off */ /* a row is a record */
static const fault_help_t k_help[FAULT_CODES] = {
    [FAULT_NONE] = {
        "none", "无", {"", ""}, {"", ""}},
    [FAULT_DRIVE] = {
        "drive-fault", "驱动器报告故障",
        {"the drive itself: overload, supply, encoder, following error; its code says which",
         "驱动器自身：过载、供电、编码器、跟随误差；具体见其故障码"},
        {"look the device code up in the drive's manual, mend the cause, then heavectl reset",
         "在驱动器手册中查找设备故障码，排除原因后执行 heavectl reset"}},
    [FAULT_DRIVE_OFFLINE] = {
        "drive-offline", "驱动器无应答",
        {"its supply or its cable is off, its address is wrong, or it has started again",
         "供电或通信电缆断开、地址错误，或驱动器重新启动"},
        {"check supply, cable, termination and address of this drive; heavectl status shows when it is back; then heavectl reset",
         "检查该驱动器的供电、电缆、终端电阻和地址；heavectl status 显示恢复后执行 heavectl reset"}},
    [FAULT_DRIVE_DROPPED] = {
        "drive-dropped", "驱动器自行退出使能状态",
        {"its enable input, its safe-torque-off or its own supervision took the torque away",
         "使能输入、安全转矩关断（STO）或驱动器自身的监控切断了转矩"},
        {"check enable and safety inputs of the drive, then heavectl reset",
         "检查驱动器的使能和安全输入，然后执行 heavectl reset"}},
    [FAULT_DRIVE_TIMEOUT] = {
        "drive-timeout", "驱动器未在规定时间内就绪",
        {"a drive does not enable, or does not find its zero", "某个驱动器无法使能，或找不到零点"},
        {"heavectl status shows which drive waits for what; mend that, then heavectl reset",
         "heavectl status 显示哪个驱动器在等待什么；排除后执行 heavectl reset"}},
    [FAULT_BUS] = {
        "bus-lost", "与驱动器的总线通信中断",
        {"the interface is down, unplugged or bus-off, or nobody acknowledges on it",
         "接口关闭、被拔出或处于 bus-off，或总线上无人应答"},
        {"check interface, cable and termination; bring the interface up again, then heavectl reset",
         "检查接口、电缆和终端电阻；重新启用接口后执行 heavectl reset"}},
    [FAULT_FOLLOWING] = {
        "following-error", "电动缸未跟随设定值",
        {"it is blocked or overloaded, its scaling or sign is wrong, or the window is too narrow",
         "卡阻或过载、比例或方向设置错误，或跟随误差窗口过窄"},
        {"check the mechanics and the load, scaling and sign; following_error_mm of [cylinders] or of the drives' section is the window; then heavectl reset",
         "检查机械和负载、比例与方向；窗口由 [cylinders] 或驱动器所在节的 following_error_mm 设定；然后执行 heavectl reset"}},
    [FAULT_BUS_FAILING] = {
        "bus-failing", "与驱动器的总线通信即将中断",
        {"too many frames are disturbed: the CAN controller has been error-passive for longer than [can] passive_stop_ms",
         "受干扰的帧过多：CAN 控制器处于 error-passive 状态的时间超过 [can] passive_stop_ms"},
        {"check cable, connectors, termination (120 ohm at both ends), grounding and bit rate; ip -s -d link show counts the errors; "
         "then heavectl reset",
         "检查电缆、接头、终端电阻（两端各 120 欧姆）、接地和波特率；ip -s -d link show 显示错误计数；然后执行 heavectl reset"}},
    [FAULT_SETPOINT_JUMP] = {
        "setpoint-jump", "设定值突跳，偏离驱动器位置",
        {"the drive was moved, or counts otherwise than before, between taking its position and its first set-point; else an error of heaved",
         "在读取位置与发送第一个设定值之间，驱动器被移动或计数方式改变；否则为 heaved 自身的错误"},
        {"the log says how far; check brake and load at rest, scaling and sign, then heavectl reset; if it comes again in motion, keep the "
         "incident and report it",
         "日志给出偏差大小；检查静止时的制动器和负载、比例与方向，然后执行 heavectl reset；如在运动中再次出现，请保留事件记录并上报"}},
    [FAULT_ESTOP_CHANNELS] = {
        "estop-channels", "急停两通道不一致",
        {"one contact is welded or does not close, or one wire is broken or has a short circuit",
         "某一触点粘连或不闭合，或某一线路断线、短路"},
        {"check both contacts and their wires; press the e-stop and release it, so that both channels open and close; then heavectl reset",
         "检查两个触点及其线路；按下并释放急停，使两通道都断开再闭合；然后执行 heavectl reset"}},
    [FAULT_POWER] = {
        "power-failing", "供电即将中断，平台未能及时回落",
        {"the supply failed while the platform was up and on hold, or [inputs] power_settle_ms is shorter than it takes to settle",
         "供电中断时平台处于升起并暂停的状态，或 [inputs] power_settle_ms 短于回落所需时间"},
        {"restore the supply, then heavectl reset; power_settle_ms has to be less than the UPS lasts, and more than it takes to settle",
         "恢复供电后执行 heavectl reset；power_settle_ms 应小于 UPS 的供电时间，且大于回落所需时间"}},
    [FAULT_OUTSIDE_STROKE] = {
        "outside-stroke", "驱动器报告的电动缸位置超出行程",
        {"the scaling, its sign, zero_counts or stroke_mm is wrong, or homing has ended at the wrong place",
         "比例、方向、zero_counts 或 stroke_mm 设置错误，或回零停在错误的位置"},
        {"the log says how far; heaved --check shows the counts of the stroke: compare them with what the drive shows, then heavectl reset",
         "日志给出超出多少；heaved --check 显示行程对应的计数，与驱动器显示的值对照并改正，然后执行 heavectl reset"}},
};
/* clang-format on */

const fault_help_t *fault_help(fault_code_t code)
{
    return &k_help[(unsigned)code < FAULT_CODES ? code : FAULT_NONE];
}

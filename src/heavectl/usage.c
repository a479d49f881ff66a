/* SPDX-License-Identifier: MIT
 * usage.c - what heavectl takes and says of itself; see usage.h.
 */
#include "heavectl/usage.h"

#include "common/message.h" // exit codes
#include "common/socket_path.h"
#include "common/usage.h"

static const usage_row_t k_forms[] = {
    {.argument = "status"},
    {.argument = "[--for SECONDS] [--hz N] watch"},
    {.argument = "--wait [--for SECONDS] engage | resume | park | shutdown"},
    {.argument = "engage | hold | resume | park | reset | shutdown | dump | incidents | seen | acknowledge"},
    {.argument = "intensity PERCENT"},
    {.argument = "service | service-off | counts"},
    {.argument = "torque N|all on|off"},
    {.argument = "jog AXIS SPEED"},
    {.argument = "home N|all"},
    {.argument = "relay N"},
    {.argument = "selftest [FILE]"},
    {.argument = "[--for SECONDS] [--hz N] scope [COLUMN,...]"},
    {.argument = "presets"},
    {0},
};

static const usage_row_t k_commands[] = {
    {.name = "status", .help = "state, poses, cylinders, relays and counters, once"},
    {.name = "watch", .help = "the same as a live table, until Ctrl-C; without a terminal, plain lines"},
    {.name = "engage", .help = "bring the platform up and follow the sender"},
    {.name = "hold", .help = "stop where it is"},
    {.name = "resume", .help = "go on with what a hold interrupted"},
    {.name = "park", .help = "settle: lowest position, at rest"},
    {.name = "reset", .help = "leave FAULT or ESTOP, once the cause is gone"},
    {.name = "shutdown", .help = "settle, drives off, end heaved"},
    {.name = "dump", .help = "write the last minutes down now, as after a fault; says where"},
    {.name = "incidents", .help = "what the black box has written, and what nobody has seen yet"},
    {.name = "seen",
     .help = "the same, and all of it has been seen: until then the first fault does not make way for later ones"},
    {.name = "acknowledge", .help = "let a configuration move that is not the approved one, until heaved ends"},
    {.name = "intensity",
     .argument = "PERCENT",
     .help = "how much of the sender's motion is made, about neutral: 0 to 100, or less where the configuration says so"},
    {.name = "service", .help = "from OFF or SETTLED, with nobody on board: moved by hand, senders are not followed"},
    {.name = "service-off", .help = "out of it: drives off"},
    {.name = "counts", .help = "what each drive counts, before there is torque too; on a terminal until Ctrl-C"},
    {.name = "torque", .argument = "N|all on|off", .help = "in service: of one drive, the others stay as they are; or of all"},
    {.name = "jog",
     .argument = "AXIS SPEED",
     .help = "in service, while a key is held: drive N, or roll, pitch, yaw, x, y or z, by 5mm/s, -2deg/s"},
    {.name = "home", .argument = "N|all", .help = "in service, while a key is held: drives find their zero"},
    {.name = "relay", .argument = "N", .help = "in service, while a key is held: away from its safe position"},
    {.name = "selftest",
     .argument = "[FILE]",
     .help = "the daily check in service, with a person at the terminal: switches, relays, ends, brakes; FILE gets the report as "
             "JSON"},
    {.name = "scope",
     .argument = "[COLUMN,...]",
     .help = "every cycle as a line of CSV, all columns or these; on a terminal some lines a second (docs/samples.md)"},
    {.name = "presets", .help = "ready-made platforms, for heaved --preset; needs no heaved"},
    {0},
};

static const usage_row_t k_options[] = {
    {"json", NULL, "answers as heaved gives them: one JSON object per line", OPTION_JSON},
    {"socket", "PATH", "else the environment's HEAVE_SOCKET, else " SOCKET_DEFAULT ", else that of the only service",
     OPTION_SOCKET},
    {"platform", "NAME", "the service heave@NAME: " SOCKET_DIRECTORY "/NAME/heaved.sock", OPTION_PLATFORM},
    {"wait", NULL, "engage, resume, park, shutdown: return once it is done, or cannot be any more", OPTION_WAIT},
    {"for", "SECONDS", "watch ends by itself; --wait waits no longer", OPTION_FOR},
    {"hz", "N", "updates per second of watch, 1 to 50; else 20, and 1 where the output is no terminal", OPTION_HZ},
    {"help", NULL, "print this", OPTION_HELP},
    {"version", NULL, "print the version", OPTION_VERSION},
    {0},
};

static const usage_exit_t k_exits[] = {
    {EXIT_DONE, "done"},
    {EXIT_REFUSED, "refused, not done in time, ended in FAULT or ESTOP at once, or gave way to a newer client"},
    {EXIT_BAD_USAGE, "usage"},
    {EXIT_UNAVAILABLE, "heaved is not running or may not be asked"},
    {EXIT_IO, "output cannot be written"},
    {0},
};

static const usage_section_t k_manual[] = {
    {"DESCRIPTION",
     "`heavectl` asks a running `heaved(8)` over its local socket. A request that the state does not allow is refused with the "
     "reason and "
     "changes nothing. Where several platforms run on one box, `--platform` says which. Members of the socket's group (`heave`, "
     "where heaved is a service) may ask; eight at a time. A ninth gets "
     "the place of one that "
     "has asked nothing for 2 s, else that of the oldest `watch`, which ends and says so. Where the configuration names groups, "
     "these say "
     "who may do more than look and hold.\n\n"
     "With `--json` every answer is an object of one line: /usr/share/doc/heave/docs/status-json.md has all its members, which "
     "stay what they "
     "are within a major version. An answer with `ok` false says in `error` why.\n"},
    {"SERVICE",
     "In service the machine is moved by hand. What moves or switches something goes on while a key is held: the terminal "
     "repeats "
     "it, and a tap moves nothing. `heavectl` tells heaved every 50 ms that the key is still held; heaved stops by itself 250 ms "
     "after it has heard that last, whatever became of `heavectl`, the terminal or the link between. Then the key has to be let "
     "go and held again. `q` or Ctrl-C ends.\n\n"
     "Nobody may be on the platform or within its reach, and the e-stop belongs into the other hand: service mode is no safety "
     "function.\n"},
    {"ENVIRONMENT", "`HEAVE_SOCKET` is the socket where none is named. `LC_ALL`, `LC_MESSAGES` "
                    "and `LANG`: faults are "
                    "told in Chinese where they begin "
                    "with zh. `NO_COLOR`: no colours, which there are on terminals only.\n"},
    {"EXAMPLES", "Bring the platform up, halve the motion, look on for ten seconds, and down again:\n"
                 " heavectl engage\n"
                 " heavectl intensity 50\n"
                 " heavectl --for 10 watch\n"
                 " heavectl park\n"
                 "Which cylinder is drive 3, and which way does it go:\n"
                 " heavectl service\n"
                 " heavectl torque 3 on\n"
                 " heavectl jog 3 2mm/s\n"
                 " heavectl service-off\n"
                 "In a script:\n"
                 " heavectl --json status | python3 -c 'import json, sys; print(json.load(sys.stdin)[\"state\"])'\n"},
    {0},
};

const usage_t heavectl_usage = {
    .program = "heavectl",
    .manual_section = "1",
    .summary = "talks to a running heaved",
    .common = "[--json] [--socket PATH | --platform NAME]",
    .forms = k_forms,
    .commands = k_commands,
    .options = k_options,
    .exits = k_exits,
    .manual = k_manual,
    .see_also = "heaved(8), heave.ini(5)",
};

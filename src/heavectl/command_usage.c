/* SPDX-License-Identifier: MIT
 * command_usage.c - what heavectl takes and says of itself; see command_usage.h.
 */
#include "heavectl/command_usage.h"

#include "common/message.h" // exit codes
#include "common/socket_path.h"
#include "common/translate.h"
#include "common/usage.h"

static const usage_row_t k_forms[] = {
    {.argument = "status"},
    {.argument = "[--for SECONDS] [--hz N] watch"},
    {.argument = "--wait [--for SECONDS] engage | resume | park | shutdown"},
    {.argument = "engage | hold | resume | park | reset | shutdown | dump | incidents | seen | acknowledge | commissioned"},
    {.argument = "intensity PERCENT"},
    {.argument = "service | service-off | counts"},
    {.argument = "torque N|all on|off"},
    {.argument = "jog AXIS SPEED [WAY]"},
    {.argument = "signal AXIS sine|step AMPLITUDE HZ SECONDS"},
    {.argument = "signal AXIS chirp|noise AMPLITUDE HZ TO_HZ SECONDS"},
    {.argument = "[--amplitude N] [--band FROM-TO] [--for SECONDS] identify AXIS [FILE]"},
    {.argument = "[--save FILE [--eds FILE] | --compare FILE] drive N"},
    {.argument = "sdo N INDEX:SUB [[TYPE] VALUE]"},
    {.argument = "home N|all"},
    {.argument = "relay N"},
    {.argument = "selftest [FILE]"},
    {.argument = "config [FILE]"},
    {.argument = "setup FILE"},
    {.argument = "[--for SECONDS] [--hz N] scope [COLUMN,...]"},
    {.argument = "profile [PROFILE]"},
    {.argument = "presets"},
    {0},
};

static const usage_row_t k_commands[] = {
    {.name = "status", .help = N_("state, poses, cylinders, relays and counters, once")},
    {.name = "watch", .help = N_("the same as a live table, until Ctrl-C; without a terminal, plain lines")},
    {.name = "engage", .help = N_("bring the platform up and follow the sender")},
    {.name = "hold", .help = N_("stop where it is")},
    {.name = "resume", .help = N_("go on with what a hold interrupted")},
    {.name = "park", .help = N_("settle: lowest position, at rest")},
    {.name = "reset", .help = N_("leave FAULT or ESTOP, once the cause is gone")},
    {.name = "shutdown", .help = N_("settle, drives off, end heaved")},
    {.name = "dump", .help = N_("write the last minutes down now, as after a fault; says where")},
    {.name = "incidents", .help = N_("what the black box has written, and what nobody has seen yet")},
    {.name = "seen",
     .help = N_("the same, and all of it has been seen: until then the first fault does not make way for later ones")},
    {.name = "acknowledge", .help = N_("let a configuration move that is not the approved one, until heaved ends")},
    {.name = "commissioned",
     .help = N_("the machine was seen to rise as it should: from now on it does so at engage speed, until the machine's keys "
                "change")},
    {.name = "intensity",
     .argument = "PERCENT",
     .help = N_("how much of the sender's motion is made, about neutral: 0 to 100, or less where the configuration says so")},
    {.name = "service", .help = N_("from OFF or SETTLED, with nobody on board: moved by hand, senders are not followed")},
    {.name = "service-off", .help = N_("out of it: drives off")},
    {.name = "counts", .help = N_("what each drive counts, before there is torque too; on a terminal until Ctrl-C")},
    {.name = "torque",
     .argument = "N|all on|off",
     .help = N_("in service: of one drive, the others stay as they are; or of all")},
    {.name = "jog",
     .argument = "AXIS SPEED [WAY]",
     .help = N_("in service, while a key is held: drive N, or roll, pitch, yaw, x, y or z, by 5mm/s, -2deg/s; so far, 5mm")},
    {.name = "signal",
     .argument = "AXIS KIND AMPLITUDE HZ [TO_HZ] SECONDS",
     .help = N_("in service, while a key is held: a test signal around where it is: sine or step; chirp or noise with TO_HZ")},
    {.name = "identify",
     .argument = "AXIS [FILE]",
     .help = N_(
         "in service, while a key is held: lag, gain and phase by a chirp, and what follows for limits; FILE gets them as CSV")},
    {.name = "drive",
     .argument = "N",
     .help =
         N_("one drive: what heaved sees of it, its identity, firmware, errors and objects in words; or with a file what it is "
            "set to, and what differs")},
    {.name = "sdo",
     .argument = "N INDEX:SUB [TYPE] [VALUE]",
     .help = N_("an object of a CANopen drive: read it, or in service set it: 6041:00; 2000:01 u16 5")},
    {.name = "home", .argument = "N|all", .help = N_("in service, while a key is held: drives find their zero")},
    {.name = "relay", .argument = "N", .help = N_("in service, while a key is held: away from its safe position")},
    {.name = "selftest",
     .argument = "[FILE]",
     .help =
         N_("the daily check in service, with a person at the terminal: switches, relays, ends, brakes; FILE gets the report as "
            "JSON")},
    {.name = "config",
     .argument = "[FILE]",
     .help =
         N_("print the configuration in force; or bring FILE into force, - is standard input: in OFF or SETTLED, with a restart "
            "of heaved where a key needs one")},
    {.name = "setup",
     .argument = "FILE",
     .help = N_("commissioning, one question after the other, in a terminal: writes the configuration FILE; needs no heaved "
                "(docs/commissioning.md)")},
    {.name = "scope",
     .argument = "[COLUMN,...]",
     .help = N_("every cycle as a line of CSV, all columns or these; on a terminal some lines a second (docs/samples.md)")},
    {.name = "profile",
     .argument = "[PROFILE]",
     .help = N_("the rigs that one service can be, /etc/heave/NAME.d/PROFILE.ini, and which it is; goes over to one, in OFF and "
                "SETTLED")},
    {.name = "presets", .help = N_("ready-made platforms, for heaved --preset; needs no heaved")},
    {0},
};

static const usage_row_t k_options[] = {
    {"json", NULL, N_("answers as heaved gives them: one JSON object per line"), OPTION_JSON},
    {"socket", "PATH", N_("else the environment's HEAVE_SOCKET, else /run/heave/heaved.sock, else that of the only service"),
     OPTION_SOCKET},
    {"platform", "NAME", N_("the service heave@NAME: /run/heave/NAME/heaved.sock"), OPTION_PLATFORM},
    {"wait", NULL,
     N_("engage, resume, park, shutdown: return once it is done, or cannot be any more; all but shutdown also wait for heaved to "
        "start"),
     OPTION_WAIT},
    {"amplitude", "N", N_("of identify, in mm or degrees; else 2 mm, 1 degree"), OPTION_AMPLITUDE},
    {"band", "FROM-TO", N_("of identify, in Hz; else 0.2-20"), OPTION_BAND},
    {"save", "FILE", N_("drive: what it is set to, into a new file (DCF)"), OPTION_SAVE},
    {"compare", "FILE", N_("drive: what differs from such a file, or any DCF; exit status 1 where something does"),
     OPTION_COMPARE},
    {"eds", "FILE", N_("of --save: the maker's file, which says what objects the drive has; else the common ones"), OPTION_EDS},
    {"for", "SECONDS", N_("watch ends by itself; --wait waits no longer; identify takes so long"), OPTION_FOR},
    {"hz", "N", N_("updates per second of watch, 1 to 50; else 20, and 1 where the output is no terminal"), OPTION_HZ},
    {"help", NULL, N_("print this"), OPTION_HELP},
    {"version", NULL, N_("print the version"), OPTION_VERSION},
    {0},
};

static const usage_exit_t k_exits[] = {
    {EXIT_DONE, N_("done")},
    {EXIT_REFUSED, N_("refused, not done in time, ended in FAULT or ESTOP at once, or gave way to a newer client")},
    {EXIT_BAD_USAGE, N_("usage")},
    {EXIT_NO_INPUT, N_("config: FILE cannot be read")},
    {EXIT_UNAVAILABLE, N_("heaved is not running or may not be asked")},
    {EXIT_IO, N_("output cannot be written")},
    {0},
};

static const usage_section_t k_manual[] = {
    {N_("DESCRIPTION"), N_("`heavectl` asks a running `heaved(8)` over its local socket. A request that the state does not allow "
                           "is refused with the "
                           "reason and "
                           "changes nothing. Where several platforms run on one box, `--platform` says which. Members of the "
                           "socket's group (`heave`, "
                           "where heaved is a service) may ask; eight at a time. A ninth gets "
                           "the place of one that "
                           "has asked nothing for 2 s, else that of the oldest `watch`, which ends and says so. Where the "
                           "configuration names groups, "
                           "these say "
                           "who may do more than look and hold.\n\n"
                           "With `--json` every answer is an object of one line: /usr/share/doc/heave/docs/status-json.md has "
                           "all its members, which "
                           "stay what they "
                           "are within a major version. An answer with `ok` false says in `error` why.\n")},
    {N_("SERVICE"),
     N_("In service the machine is moved by hand. What moves or switches something goes on while a key is held: the terminal "
        "repeats "
        "it, and a tap moves nothing. `heavectl` tells heaved every 50 ms that the key is still held; heaved stops by itself 250 "
        "ms "
        "after it has heard that last, whatever became of `heavectl`, the terminal or the link between. Then the key has to be "
        "let "
        "go and held again. `q` or Ctrl-C ends.\n\n"
        "Nobody may be on the platform or within its reach, and the e-stop belongs into the other hand: service mode is no "
        "safety "
        "function.\n")},
    {N_("SETUP"),
     N_("`heavectl setup FILE` needs no heaved: it starts one of its own, in service, on the configuration in the making, which "
        "ends "
        "with it. Every answer is kept in FILE.setup at once, and setup goes on there, whatever ended it. It writes FILE, with "
        "comments, and FILE.report.txt, .html and .json in the end, when it is told to. "
        "/usr/share/doc/heave/docs/commissioning.md\n")},
    {N_("DRIVES"),
     N_("`heavectl drive 3` shows what heaved sees of a drive and, of CANopen drives in OFF, SERVICE, FAULT and ESTOP, what its "
        "own "
        "objects say: identity, firmware, state, torque, inputs, and the errors that it has kept. `heavectl sdo` reads or sets "
        "one "
        "object. Objects that heaved itself relies on, and those that say how long a count is, are never set.\n\n"
        "Save what each drive is set to once the machine runs. When a drive is exchanged, `--compare` says what the new one "
        "lacks.\n")},
    {N_("ENVIRONMENT"),
     N_("`HEAVE_SOCKET` is the socket where none is named. `LANGUAGE`, `LC_ALL`, `LC_MESSAGES` and `LANG` choose the language, "
        "as "
        "for other programs: Chinese where they begin with zh, on a terminal with UTF-8. The locale need not be installed. "
        "`HEAVE_LOCALES` is another folder of translations. `NO_COLOR`: no colours, which there are on terminals only.\n")},
    {N_("EXAMPLES"), N_("Bring the platform up, halve the motion, look on for ten seconds, and down again:\n"
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
                        " heavectl --json status | python3 -c 'import json, sys; print(json.load(sys.stdin)[\"state\"])'\n")},
    {0},
};

const usage_t heavectl_usage = {
    .program = "heavectl",
    .manual_section = "1",
    .summary = N_("talks to a running heaved"),
    .common = "[--json] [--socket PATH | --platform NAME]",
    .forms = k_forms,
    .commands = k_commands,
    .options = k_options,
    .exits = k_exits,
    .manual = k_manual,
    .see_also = "heaved(8), heave.ini(5)",
};

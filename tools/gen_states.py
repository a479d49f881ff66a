#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""gen_states.py - the state diagram and tables of docs/operation.md, drawn from the rows of src/gateway/supervisor.c.

    tools/gen_states.py [--lang en|zh|js]              print the block
    tools/gen_states.py [--lang en|zh|js] --check FILE exit 1, with a diff, if the block between FILE's markers differs
    tools/gen_states.py [--lang en|zh|js] --write FILE put the block there

The markers are <!-- states:begin --> and <!-- states:end -->. A file name that holds ".zh" means --lang zh. --lang js is panel/states.js, the whole file: the rows themselves, for the diagram
of the panel.
"""
import argparse
import difflib
import json
import pathlib
import re
import signal
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- states:begin -->", "<!-- states:end -->"

# Who causes an event; every event of the header must be here.
ACTORS = {
    "operator": ["engage", "hold", "resume", "park", "reset", "shutdown", "service", "service-off"],
    "sender": ["frame", "silence-hold", "silence-neutral", "silence-settle"],
    "machine": ["drives-ready", "fault", "estop"],
    "itself": ["move-done", "tick"],
}

EN = {
    "head": ["State", "What the platform does", "Who brings it there", "What comes next"],
    "actors": {"operator": "operator", "sender": "sender", "machine": "machine", "itself": "by itself"},
    "states": None,  # the comments of the header
    "events": {"move-done": "move done", "tick": "next cycle", "drives-ready": "drives ready", "estop": "e-stop",
               "silence-hold": "silence (hold)", "silence-neutral": "silence (neutral)",
               "silence-settle": "silence (settle)"},
    "guards": {"COMES_UP_SETTLED": "at the settled extension", "GOAL_OFF": "goal OFF", "GOAL_UP": "goal up",
               "GOAL_ENGAGED": "goal ENGAGED", "BY_SILENCE": "held by silence", "WAS_HOMING": "was HOMING",
               "WAS_RISING": "was RISING", "WAS_NEUTRAL": "was NEUTRAL", "WAS_ENGAGED": "was ENGAGED",
               "WAS_SETTLING": "was SETTLING", "COMING_UP": "drives come up", "STANDS_STILL": "at rest, no fault", "FAULT_CLEARED": "cause gone, at rest",
               "ESTOP_RELEASED": "released, no fault"},
    "any": "any state",
    "note": "`FAULT` and `ESTOP` are entered from every state (`FAULT` not from `ESTOP`) and are left by reset only.",
    "needs": "What these requests need beside the state. While a shutdown is under way, of all requests for a state heaved takes only hold, shutdown and reset.",
    "needs_head": ["Request", "In", "Needs"],
    "loss": "What heaved does by itself, as if an operator had asked for it:",
    "loss_head": ["What happens", "In", "Request"], "nothing": "none",
    "permits": {"KEY": "enable key on", "SUPPLY": "supply well", "APPROVAL": "configuration approved",
                "SELFTEST": "self-test passed (where one is due)"},
    "losses": {"KEY": "the enable key is turned off", "SUPPLY": "the supply fails",
               "PUNCTUAL": "more cycles are late at once than `late_hold_cycles`"},
    "colon": ": ", "comma": ", ", "semicolon": "; ", "brackets": " [{}]", "or": " or ",
}

ZH = {
    "head": ["状态", "平台在做什么", "由谁触发", "接下来"],
    "actors": {"operator": "操作员", "sender": "发送端", "machine": "设备", "itself": "自动"},
    "states": {"OFF": "驱动器未使能", "HOMING": "驱动器上电使能、回零，再以投入速度移到回落位",
               "SETTLED": "最低位，静止；可以上下人", "RISING": "以投入速度升到中位姿态",
               "NEUTRAL": "已升起，静止，不跟随", "ENGAGED": "跟随发送端", "HOLD": "停在原处，驱动器仍使能",
               "SETTLING": "以投入速度降到回落位",
               "SERVICE": "检修，平台上无人：按住按键时逐轴手动移动；不跟随发送端", "FAULT": "锁存：按故障类别停止，然后驱动器失能",
               "ESTOP": "锁存：目标立即停止，设定值跟随实际位置"},
    "events": {"engage": "投入", "hold": "暂停", "resume": "继续", "park": "回落", "reset": "复位", "shutdown": "关机",
               "frame": "收到帧", "silence-hold": "静默（暂停）", "silence-neutral": "静默（中位）",
               "silence-settle": "静默（回落）", "drives-ready": "驱动器就绪", "fault": "故障", "estop": "急停",
               "move-done": "动作完成", "tick": "下一周期", "service": "检修", "service-off": "退出检修"},
    "guards": {"COMES_UP_SETTLED": "位于回落位", "GOAL_OFF": "目标为 OFF", "GOAL_UP": "目标在上方",
               "GOAL_ENGAGED": "目标为 ENGAGED", "BY_SILENCE": "因静默进入", "WAS_HOMING": "原为 HOMING",
               "WAS_RISING": "原为 RISING", "WAS_NEUTRAL": "原为 NEUTRAL", "WAS_ENGAGED": "原为 ENGAGED",
               "WAS_SETTLING": "原为 SETTLING", "COMING_UP": "驱动器正在使能或回零", "STANDS_STILL": "静止且无故障", "FAULT_CLEARED": "原因已消除且静止",
               "ESTOP_RELEASED": "已松开且无故障"},
    "any": "任意状态",
    "note": "任何状态都可进入 `FAULT` 和 `ESTOP`（`ESTOP` 不会转入 `FAULT`），只能通过复位离开。",
    "needs": "除状态外，下列请求还需要满足的条件。关机过程中，改变状态的请求里 heaved 只接受暂停、关机和复位。",
    "needs_head": ["请求", "所在状态", "需要"],
    "loss": "heaved 自行执行的动作，等同于操作员发出的请求：",
    "loss_head": ["发生什么", "所在状态", "请求"], "nothing": "无",
    "permits": {"KEY": "使能钥匙接通", "SUPPLY": "电源正常", "APPROVAL": "配置已批准",
                "SELFTEST": "自检已通过（如果要求自检）"},
    "losses": {"KEY": "使能钥匙断开", "SUPPLY": "电源即将断电", "PUNCTUAL": "一次延误的周期数超过 `late_hold_cycles`"},
    "colon": "：", "comma": "、", "semicolon": "；", "brackets": "（{}）", "or": " 或",
}


def fail(text):
    sys.exit("gen_states.py: " + text)


def unique(items):
    return list(dict.fromkeys(items))


def read_header():
    """State name -> meaning, in the order of the enum."""
    text = (ROOT / "include/heave/supervisor.h").read_text(encoding="utf-8")
    states = dict(re.findall(r"^\s*STATE_(\w+),\s*/\*\*< (.+?) \*/", text, re.M))
    events = [e.lower().replace("_", "-") for e in re.findall(r"^\s*EVENT_(\w+),", text, re.M)]
    known = sum(ACTORS.values(), [])
    if sorted(events) != sorted(known):
        fail("ACTORS and the header's events differ: %s" % sorted(set(events) ^ set(known)))
    return states


def read_table(name, pattern):
    """The groups of the pattern in every row of a table."""
    text = (ROOT / "src/gateway/supervisor.c").read_text(encoding="utf-8")
    table = re.search(name + r"\[\] = \{(.*?)\n\};", text, re.S)
    if not table:
        fail("no %s in supervisor.c" % name)
    body = re.sub(r"/\*.*?\*/", "", table.group(1), flags=re.S)
    for line in filter(None, (part.strip() for part in body.split("\n"))):
        row = re.fullmatch(pattern, line)
        if not row:
            fail("cannot read the row: " + line)
        yield row.groups()


def read_all_rows():
    """(from, event, guard, needs, to) of every row, in table order."""
    for source, event, guard, needs, target in read_table("k_rows", r"\{(?:STATE_)?(\w+),\s*EVENT_(\w+),\s*(\w+),\s*(\w+),\s*(?:STATE_)?(\w+),\s*\w+,\s*\w+,\s*\w+\},"):
        yield source, event.lower().replace("_", "-"), guard, needs, target


def read_needs():
    """The permits of each set that rows name."""
    text = (ROOT / "src/gateway/supervisor.c").read_text(encoding="utf-8")
    sets = {}
    for name, value in re.findall(r"^#define (NONE|RUNNING|UP|FIRST) +(.+?)(?: +/\*.*)?$", text, re.M):
        sets[name] = [permit for word in re.findall(r"\w+", value) for permit in sets.get(word, [word.removeprefix("PERMIT_")] if word != "0u" else [])]
    return sets


def read_rows(states):
    """(from, event, guard, to) of every row that changes the state, in table order."""
    rows = []
    for source, event, guard, _, target in read_all_rows():
        if source not in states and source != "ANY" or target not in states and target != "STAY":
            fail("unknown state in the row: %s %s" % (source, event))
        if target != "STAY":
            rows.append((source, event, guard, target))
    if {target for source, _, _, target in rows if source == "ANY"} != {"FAULT", "ESTOP"}:
        fail("the note below the table says that only FAULT and ESTOP are entered from every state")
    return rows


def event_text(words, event):
    return words["events"].get(event, event)


def group(words, pairs):
    """Texts of (event, guard) pairs: events with the same guards share one pair of brackets."""
    guards_of = {}
    for event, guard in pairs:
        guards_of.setdefault(event, []).append(guard)
    texts = []
    for guards in unique(tuple(g) for g in guards_of.values()):
        events = words["comma"].join(event_text(words, e) for e, g in guards_of.items() if tuple(g) == guards)
        condition = words["or"].join(words["guards"][g] for g in guards if g != "ALWAYS")
        texts.append(events if "ALWAYS" in guards else events + words["brackets"].format(condition))
    return texts


def diagram(words, rows):
    lines = ["```mermaid", "stateDiagram-v2", '    state "%s" as ANY' % words["any"], "    [*] --> OFF"]
    for source, target in unique((r[0], r[3]) for r in rows):
        pairs = [(r[1], r[2]) for r in rows if (r[0], r[3]) == (source, target)]
        lines.append("    %s --> %s : %s" % (source, target, "<br/>".join(group(words, pairs))))
    return lines + ["```"]


def entered_by(words, rows, state):
    """Who brings the platform into the state, and with which event."""
    parts = []
    for actor, events in ACTORS.items():
        causes = unique(event_text(words, r[1]) for r in rows if r[3] == state and r[1] in events)
        if causes:
            parts.append(words["actors"][actor] + words["colon"] + words["comma"].join(causes))
    return words["semicolon"].join(parts)


def leads_to(words, rows, state):
    parts = []
    for target in unique(r[3] for r in rows if r[0] == state):
        pairs = [(r[1], r[2]) for r in rows if (r[0], r[3]) == (state, target)]
        parts.append(words["semicolon"].join(group(words, pairs)) + " → `" + target + "`")
    return "<br>".join(parts)


def table(words, states, rows):
    lines = ["| " + " | ".join(words["head"]) + " |", "| --- | --- | --- | --- |"]
    for state, meaning in states.items():
        if words["states"]:
            meaning = words["states"][state]
        lines.append("| `%s` | %s | %s | %s |" % (state, meaning, entered_by(words, rows, state),
                                                 leads_to(words, rows, state)))
    return lines + ["", words["note"]]


def places(words, pairs):
    """Texts of (state, guard) pairs. A state with several guards stands for itself: the others have rows of their own."""
    guards_of = {}
    for state, guard in pairs:
        guards_of.setdefault(state, []).append(guard)
    return words["comma"].join("`%s`" % state + (words["brackets"].format(words["guards"][guards[0]]) if len(guards) == 1 and guards[0] != "ALWAYS" else "")
                               for state, guards in guards_of.items())


def needs_table(words):
    """What a request needs, where it needs anything."""
    sets, found = read_needs(), {}
    for source, event, guard, needs, _ in read_all_rows():
        if needs not in ("NONE", "RUNNING"):
            found.setdefault((event, needs), []).append((source, guard if guard.startswith("WAS_") else "ALWAYS"))
    lines = [words["needs"], "", "| " + " | ".join(words["needs_head"]) + " |", "| --- | --- | --- |"]
    for event in ACTORS["operator"]:
        for (name, needs), pairs in found.items():
            if name == event:
                lines.append("| %s | %s | %s |" % (event_text(words, event), places(words, pairs), words["comma"].join(words["permits"][p] for p in sets[needs] if p != "RUNNING")))
    return lines


def loss_table(words):
    """What follows where a permit is lost."""
    found = {}
    for source, lost, guard, request in read_table("k_responses", r"\{STATE_(\w+),\s*([A-Z_ |]+),\s*(\w+),\s*(\w+)\},"):
        for permit in re.findall(r"PERMIT_(\w+)", lost):
            found.setdefault((permit, request), []).append((source, guard))
    lines = [words["loss"], "", "| " + " | ".join(words["loss_head"]) + " |", "| --- | --- | --- |"]
    for permit in words["losses"]:
        for (name, request), pairs in found.items():
            if name == permit:
                event = request.removeprefix("EVENT_").lower().replace("_", "-")
                lines.append("| %s | %s | %s |" % (words["losses"][permit], places(words, pairs), words["nothing"] if request == "EVENTS" else event_text(words, event)))
    return lines


def block(lang):
    words = {"en": EN, "zh": ZH}[lang]
    states = read_header()
    rows = read_rows(states)
    try:
        parts = [diagram(words, rows), table(words, states, rows), needs_table(words), loss_table(words)]
        return "\n\n".join("\n".join(part) for part in parts) + "\n"
    except KeyError as missing:
        fail("no %s text for %s" % (lang, missing))


def module():
    rows = read_rows(read_header())
    lines = ["// SPDX-License-Identifier: MIT", "// states.js - made by tools/gen_states.py from src/gateway/supervisor.c: [from, event, condition, to] of every row that changes the state.", "export const ROWS = ["]
    lines += ["  [%s]," % ", ".join('"%s"' % part for part in row) for row in rows]
    actors = ["export const ACTORS = {"] + ["  %s: [%s]," % (actor, ", ".join('"%s"' % event for event in events)) for actor, events in ACTORS.items()]
    words = {lang: {"events": {event: event_text(words, event) for event in sum(ACTORS.values(), [])}, "guards": words["guards"], "actors": words["actors"]} for lang, words in (("en", EN), ("zh", ZH))}
    return "\n".join(lines + ["];"] + actors + ["};", "export const WORDS = %s;" % json.dumps(words, ensure_ascii=False, indent=1)]) + "\n"


def split(path):
    """The file's text up to and with the begin marker, between the markers, and from the end marker on."""
    text = path.read_text(encoding="utf-8") if path.exists() or path.suffix != ".js" else ""
    if path.suffix == ".js":
        return "", text, ""
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        fail("%s: needs one %s and, after it, one %s" % (path, BEGIN, END))
    start, end = text.index(BEGIN) + len(BEGIN), text.index(END)
    return text[:start] + "\n", text[start:end].removeprefix("\n"), text[end:]


def check(path, wanted):
    old = split(path)[1]
    if old == wanted:
        return 0
    sys.stdout.writelines(difflib.unified_diff(old.splitlines(True), wanted.splitlines(True), str(path), "supervisor.c"))
    print("%s: the states differ from src/gateway/supervisor.c; run tools/gen_states.py --write %s" % (path, path))
    return 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lang", choices=["en", "zh", "js"])
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--check", metavar="FILE", type=pathlib.Path)
    mode.add_argument("--write", metavar="FILE", type=pathlib.Path)
    args = parser.parse_args()
    path = args.check or args.write
    lang = args.lang or ("js" if path and path.suffix == ".js" else "zh" if path and ".zh" in path.name else "en")
    wanted = module() if lang == "js" else block(lang)
    if args.check:
        return check(path, wanted)
    if args.write:
        before, _, after = split(path)
        path.write_text(before + wanted + after, encoding="utf-8")
        return 0
    sys.stdout.buffer.write(wanted.encode("utf-8"))
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends it without a word, as other programs
    sys.exit(main())

// SPDX-License-Identifier: MIT
// text.js - every text of the pages, in English and Chinese. A test finds one that is missing.
import { store } from "./store.js";

export const TEXT = {
  hold: ["HOLD", "暂停"], holdHelp: ["Hold: stops where it is. Key: Escape", "暂停：平台在原地停下。按键：Escape"],
  connected: ["connected", "已连接"], lost: ["CONNECTION LOST - buttons do nothing", "连接已断开，按钮无效"], gone: ["heaved is not running", "heaved 未运行"],
  noNews: ["No news for", "数据未更新："], noAnswer: ["no answer yet. Use the e-stop if it has to stop.", "尚无应答。必须停止时请按急停。"], underWay: ["under way", "正在执行"], configure: ["Apply", "应用"],
  language: ["中文", "English"], logout: ["Log out", "退出登录"],
  operate: ["Operate", "操作"], live: ["Live", "实时"], service: ["Service", "检修"], incidents: ["Incidents", "事故记录"], wall: ["All platforms", "全部平台"],
  login: ["Log in", "登录"], role: ["Role", "角色"], password: ["Password", "密码"], look: ["look", "查看"], operateRole: ["operate", "操作"], serviceRole: ["service", "检修"],
  engage: ["Start", "启动"], resume: ["Resume", "继续"], park: ["Board (park)", "上下客（回落）"], reset: ["Reset", "复位"], take: ["Take the controls", "取得控制权"], drop: ["Give the controls back", "交还控制权"],
  yours: ["You have the controls", "您拥有控制权"], nobody: ["Nobody has the controls", "无人控制"], others: ["has the controls", "拥有控制权"],
  controls: ["Controls", "控制"], intensity: ["Intensity", "强度"], apply: ["Apply", "应用"],
  sender: ["Sender", "发送端"], noSender: ["Waiting for a sender", "等待发送端"], period: ["period", "周期"], jitter: ["jitter", "抖动"], delay: ["delay", "延迟"], losses: ["lost", "丢失"], age: ["newest frame", "最新帧"],
  even: ["even in time", "时间均匀"], bursts: ["frames come in bursts", "帧成批到达"], arrivals: ["poses belong to the time of sending", "位姿对应发送时刻"],
  drives: ["Drives", "驱动器"], drive: ["drive", "驱动器"], sent: ["set-point", "设定值"], actual: ["actual", "实际值"], state: ["state", "状态"], homed: ["zero", "零点"], yes: ["found", "已找到"], no: ["not found", "未找到"],
  pose: ["Pose", "位姿"], asked: ["asked", "要求"], axis: ["axis", "轴"], relays: ["Relays", "继电器"], none: ["none", "无"], on: ["on", "接通"], unknown: ["not known", "未知"],
  bus: ["Bus", "总线"], latency: ["Cycle", "周期"], late: ["late cycles", "迟到周期"], wake: ["wake-up 99.9 %", "唤醒 99.9 %"],
  fault: ["Fault", "故障"], cause: ["Cause", "原因"], remedy: ["Remedy", "处理方法"], onAxis: ["axis", "轴"], estop: ["The e-stop is pressed", "急停已按下"], power: ["The supply is failing", "电源即将断电"],
  due: ["A self-test is due: heavectl selftest", "需要自检：heavectl selftest"], barred: ["This is not the approved configuration", "当前配置未经批准"],
  slowRise: ["Nobody has seen this machine rise as it is configured now: it rises at a tenth of engage speed. Look, then: heavectl commissioned", "还没有人看过机器按当前配置升起：以投入速度的十分之一升起。看过之后运行 heavectl commissioned"],
  putBack: ["The configuration that was applied could not be started; the one before it is in force again:", "应用的配置无法启动，已恢复之前的配置："],
  machine: ["The machine", "机器"], picture: ["The platform: drag to turn it", "平台：拖动可旋转"], ghost: ["asked for", "要求的位姿"], closeToEnd: ["10 % from an end", "距行程端点 10% 以内"], atEnd: ["at an end", "到达行程端点"],
  legend: ["Numbers: how far a cylinder is out, mm. Arrow keys or a finger turn the picture.", "数字：各电动缸的伸出量，mm。可用方向键或手指旋转画面。"], nearEnd: ["Cylinders near an end of their stroke", "接近行程端点的电动缸"], limitOf: ["Axes at their limit", "到达限位的轴"], farFromLimits: ["All cylinders and axes are away from their limits.", "各电动缸和各轴均未接近限位。"],
  noWebGL: ["This browser has no WebGL: a flat picture.", "此浏览器不支持 WebGL，显示平面图。"], slowWebGL: ["This browser has no graphics card to draw with: a flat picture.", "此浏览器没有可用的显卡，显示平面图。"], allTheSame: ["In 3D all the same", "仍以三维显示"], noScene: ["This panel was built without its 3D part: a flat picture.", "此面板构建时未包含三维部分，显示平面图。"],
  goal: ["goes to", "目标"], states: ["States", "状态图"], anyTime: ["From every state: a fault leads to FAULT, the e-stop to ESTOP.", "任何状态下：故障进入“故障”，急停进入“急停”。"],
  latencies: ["Latencies", "延迟"], frameLatency: ["Frame to drives", "帧到驱动器"], wakeLatency: ["Wake-up of a cycle", "周期唤醒"], cycleTime: ["Work of a cycle", "周期运算"], most: ["longest", "最长"], sinceStart: ["since the start of heaved", "自 heaved 启动以来"],
  busAndRelays: ["Bus and relays", "总线与继电器"], driveCode: ["code of the drive", "驱动器代码"], isOver: ["over", "已消除"], following: ["error", "跟随误差"], feedbackAge: ["age, ms", "反馈时间，ms"], torque: ["torque", "转矩"], node: ["node", "节点"], rotation: ["rotation", "旋转"],
  noneComplains: ["No drive complains.", "驱动器均无异常。"], fine: ["no trouble", "无异常"], simulated: ["simulated drives: none", "模拟驱动器，无总线"], lastTrouble: ["last trouble", "上次异常"],
  askedGroup: ["Pose: asked for", "位姿：要求值"], followingGroup: ["Drives: following error", "驱动器：跟随误差"], drivesGroup: ["Drives: state (0 offline to 5 fault)", "驱动器：状态（0 离线至 5 故障）"], torqueGroup: ["Drives: torque", "驱动器：转矩"], ageGroup: ["Latency: age of the newest frame", "延迟：最新帧的时间"], cycleGroup: ["Latency: wake-up and work of each cycle", "延迟：各周期的唤醒与运算"],
  chosen: ["Curve", "曲线"], noLine: ["No line above the rounding.", "没有高于舍入误差的谱线。"],
  curves: ["Curves", "曲线"], group: ["Group", "分组"], span: ["Time", "时长"], pause: ["Pause", "暂停"], go: ["Go on", "继续显示"], rows: ["rows lost", "丢失行数"], cursor: ["at the cursor", "光标处"],
  translations: ["Pose: x, y, z", "位姿：x、y、z"], rotations: ["Pose: roll, pitch, yaw", "位姿：横滚、俯仰、偏航"], cylinders: ["Cylinders: actual", "电动缸：实际值"], errors: ["Cylinders: set-points", "电动缸：设定值"],
  spectrum: ["Spectrum and trigger", "频谱与触发"], strongest: ["strongest", "最强"],
  enterService: ["Enter service", "进入检修"], leaveService: ["Leave service: drives off", "退出检修：驱动器断电"], torqueOn: ["Torque on, all", "全部使能"], torqueOff: ["Torque off, all", "全部失能"],
  serviceHelp: ["With nobody on board. Hold a button to move; let go to stop.", "平台上不得有人。按住按钮运动，松开即停。"], speed: ["Speed", "速度"], homeAll: ["Home all (hold)", "全部回零（按住）"], notService: ["The machine is not in service.", "机器不在检修状态。"],
  incidentHelp: ["What the black box has written: the time before each fault and e-stop.", "黑匣子的记录：每次故障和急停之前的数据。"], seen: ["I have seen them", "已查看"], dump: ["Keep the last two minutes", "保存最近两分钟"], new: ["new", "新"], asDump: ["on request", "按要求"], noIncidents: ["None.", "没有记录。"],
  open: ["Open", "打开"], download: ["Download", "下载"], loading: ["Loading…", "正在加载……"], time: ["Time", "时间"], what: ["What", "事件"], timeLine: ["Time line", "时间线"], play: ["Play", "播放"], atSpeed: ["Speed", "速度"],
  length: ["Length", "时长"], framesHad: ["frames", "帧数"], zoomIn: ["Zoom in", "放大"], zoomOut: ["Zoom out", "缩小"], noGeometry: ["The configuration of then does not tell the mechanism by itself: no picture.", "当时的配置不足以确定机构尺寸，无法显示图形。"],
  fromSender: ["sender", "发送端"], wasFault: ["fault", "故障"], atDrive: ["drive", "驱动器"], atEstop: ["e-stop", "急停"], wasLate: ["late cycles", "迟到周期"], wasReload: ["configuration", "配置"], wasRequest: ["request", "请求"],
  sentMm: ["x, y, z: set-points", "x、y、z：设定值"], sentDeg: ["roll, pitch, yaw: set-points", "横滚、俯仰、偏航：设定值"],
  trigger: ["Trigger", "触发"], armed: ["Waits for the level", "等待电平"], met: ["Triggered", "已触发"], level: ["Level", "电平"], between: ["Between the marks", "标记之间"],
  marksHelp: ["While it stands still: drag to move, pinch or turn the wheel to zoom, two taps measure. Trigger: stands still where the curve rises through the level.", "画面暂停时：拖动可平移，双指或滚轮可缩放，点两下即可测量。触发：曲线上升通过电平后画面暂停。"],
  record: ["Record every cycle", "记录每个周期"], recordStop: ["Stop and save:", "停止并保存："],
  log: ["Log of operators", "操作日志"], who: ["Who", "操作者"], cameOf: ["Result", "结果"], done: ["done", "已执行"], find: ["Find", "查找"], again: ["Read again", "重新读取"],
  configuration: ["Configuration", "配置"], config_text: ["As text", "文本"], config_sizes: ["Sizes", "尺寸"], config_changes: ["Changes, and apply", "更改与应用"],
  configFile: ["File", "文件"], configForce: ["In force", "当前生效"], configApplied: ["what was applied over this file", "在该文件之上应用的配置"], configOwn: ["this file", "该文件"],
  configHint: ["Put the cursor on a key to see what it means.", "将光标放在某个参数上，可查看其含义。"], configReport: ["What follows from it (heaved --check)", "计算结果（heaved --check）"],
  configRight: ["No mistakes. Nothing changes before it is applied.", "没有错误。应用之前不会有任何更改。"], configSame: ["This is the configuration in force.", "与当前生效的配置相同。"], configWords: ["Only comments or the order differ.", "仅注释或顺序不同。"],
  checking: ["Being checked…", "正在检查……"], mistakes: ["Mistakes", "错误"], line: ["line", "行"],
  draftRestored: ["What you had not applied yet is here again.", "您尚未应用的修改已恢复。"], draftStale: ["Somebody else has brought another configuration into force. Your text is kept.", "其他人已应用了另一份配置。您的文本已保留。"],
  draftRebase: ["Compare with the one in force", "与当前生效的配置比较"], draftRevert: ["Drop my changes", "放弃我的修改"], draftNowhere: ["heaved has no state directory: it cannot keep another configuration.", "heaved 没有状态目录，无法保存新的配置。"],
  keyHelp: ["This key", "当前参数"], findKey: ["Find a key", "查找参数"], addKey: ["Add it with its default", "以默认值添加"], goToLine: ["Go to line", "转到行"], keyAllowed: ["allowed", "允许值"], keyDefault: ["default", "默认值"], keyRequired: ["required", "必填"],
  keyUnit: ["unit", "单位"], keyChanges: ["changes", "生效方式"], keyLive: ["at once", "立即生效"], keyRestart: ["with a restart of heaved", "heaved 重新启动后生效"],
  applyNow: ["Apply now", "立即应用"], applyKept: ["The one in force now is kept. The file itself is never written.", "当前生效的配置会被保留，原文件不会被改写。"], applyLive: ["In OFF, SETTLED or SERVICE, with nobody on the way up or down. It takes effect at once.", "仅在关闭、已回落或检修状态下可用，立即生效。"],
  applyRestart: ["In OFF or SETTLED. The drives go off, heaved starts anew.", "仅在关闭或已回落状态下可用。驱动器断电，heaved 重新启动。"], applied: ["It is in force.", "已生效。"], appliedRestart: ["It is kept: heaved starts anew with it.", "已保存：heaved 将以新配置重新启动。"],
  sizesHelp: ["Measured from joint centre to joint centre. Empty: the default.", "按铰点中心测量。留空则使用默认值。"], bySizes: ["By sizes", "按尺寸"], byJoints: ["Joint by joint", "逐个铰点"], fromAbove: ["From above", "俯视图"], inAPose: ["In a pose", "指定位姿"], extension: ["extension", "伸出量"], stroke: ["stroke", "行程"],
  size_base_radius_mm: ["Circle of the lower joints, radius", "下铰点圆半径"], size_base_spread_deg: ["Angle of a lower pair", "下铰点对夹角"], size_base_turn_deg: ["Lower circle, turned", "下铰点圆转角"],
  size_plate_radius_mm: ["Circle of the upper joints, radius", "上铰点圆半径"], size_plate_spread_deg: ["Angle of an upper pair", "上铰点对夹角"], size_plate_turn_deg: ["Upper circle, turned", "上铰点圆转角"],
  size_retracted_length_mm: ["Length, fully in", "完全缩回时长度"], size_stroke_mm: ["Stroke", "行程"], size_margin_mm: ["Margin at the ends", "端部余量"], size_zero_height_mm: ["Height at pose zero", "零位高度"], size_mrp_mm: ["Motion reference point", "运动参考点"],
  size_base_joint: ["Lower joint", "下铰点"], size_plate_joint: ["Upper joint", "上铰点"],
  commission: ["Commission", "调试"], commissionHelp: ["Step by step, with nobody on the platform. What is found stays in this browser: it can be left and continued.", "逐步进行，平台上不得有人。结果保存在此浏览器中，可以中断后继续。"],
  step_inventory: ["What is there", "设备清单"], step_legs: ["Which leg is which", "识别各缸"], step_zeros: ["Zeros", "回零"], step_ends: ["Ends", "行程两端"], step_outputs: ["Relays", "继电器"], step_switches: ["Switches", "开关"], step_signals: ["Test signals", "测试信号"], step_report: ["Report", "报告"],
  stepDone: ["Done: next step", "完成，下一步"], stepOpen: ["Not done after all", "取消完成标记"], print: ["Print, or save as PDF", "打印或另存为 PDF"], beginAnew: ["Forget all of it and begin anew", "清除全部结果并重新开始"], steps: ["Steps", "步骤"],
  inventoryHelp: ["Every drive has to answer. Scanning a bus that heaved does not run on: heaved --doctor.", "每个驱动器都必须有应答。heaved 未运行时扫描总线：heaved --doctor。"], noBus: ["No bus: simulated drives.", "无总线：仿真驱动器。"], report: ["reports", "上报"], countsTitle: ["Counts", "计数"],
  countsHelp: ["Turn a spindle by hand: its count has to change, and rise outwards.", "用手转动丝杠：对应的计数应变化，伸出时应增大。"], counts: ["counts", "计数"], torque: ["torque", "使能"],
  legsHelp: ["Hold a button: one cylinder moves by 5 mm. Say which one it was, and which way + went.", "按住按钮，一个缸运动 5 毫米。请选择是哪个缸，以及 + 的方向。"], movedLeg: ["moved", "运动的缸"], plusIs: ["+ goes", "+ 的方向"], severalLegs: ["none, or several", "没有或多个"], way_out: ["out", "伸出"], way_in: ["in", "缩回"],
  legOther: ["not one cylinder moves with it: look at its wiring and its node.", "没有单独一个缸随之运动：请检查接线和节点号。"], legIs: ["moves cylinder", "带动的是缸"], legSwap: ["Exchange the drives' addresses in the configuration, or their cables.", "请在配置中交换驱动器地址，或交换电缆。"],
  legBackwards: ["runs backwards: change the sign of its scaling, or its polarity in the drive.", "方向相反：请更改比例的符号，或更改驱动器极性。"], legsRight: ["Each drive moves its own cylinder, outwards with +.", "各驱动器带动各自的缸，+ 为伸出方向。"],
  zerosHelp: ["Drives find their zero while the button is held. Let go, and they stop.", "按住按钮期间驱动器回零，松开即停。"], homeOne: ["Home", "回零"],
  endsHelp: ["Go to both ends. What was reached is written down by itself.", "运动到行程两端，到达的位置会自动记录。"], toLower: ["In", "缩回"], toUpper: ["Out", "伸出"], together: ["All together (z)", "全部一起（z）"], leastSeen: ["least", "最小"], mostSeen: ["most", "最大"], following: ["following error", "跟随误差"],
  outputsHelp: ["Hold a button: the relay switches. Say whether what is behind it works.", "按住按钮，继电器动作。请确认所接设备是否工作。"], noRelays: ["This platform has no relays.", "本平台没有继电器。"], relay: ["Relay", "继电器"], holdOn: ["Switch (hold)", "动作（按住）"], hasWorked: ["works", "是否正常"], worked_yes: ["yes", "正常"], worked_no: ["NO", "不正常"], worked_none: ["nothing connected", "未连接"],
  switchesHelp: ["Press each switch and release it. The page notices both.", "逐个按下并松开开关，页面会自动识别。"], noSwitches: ["No switches are configured.", "未配置开关。"], switch_estop: ["E-stop", "急停"], switch_estop2: ["E-stop, second channel", "急停第二通道"], switch_enable: ["Enable key", "使能钥匙"], switch_power: ["Supply contact", "电源触点"], switch_pulse: ["Safety relay drops", "安全继电器断开"],
  isOpen: ["pressed", "已按下"], isClosed: ["released", "已松开"], seenOpen: ["pressed seen", "按下已识别"], seenClosed: ["released seen", "松开已识别"],
  signalsHelp: ["Away from the ends, torque on, zeros found. Hold the button until it says so, about a minute: a chirp, and what the feedback does with it. As heavectl identify.", "离开行程两端，已使能并已回零。按住按钮直到提示完成，约一分钟：发出扫频信号并计算反馈响应，与 heavectl identify 相同。"],
  amplitude: ["Amplitude", "幅值"], fromHz: ["From Hz", "起始频率 Hz"], toHz: ["To Hz", "终止频率 Hz"], holdSignal: ["Chirp (hold)", "扫频（按住）"], signalGoes: ["The signal goes on:", "信号进行中："], signalWorks: ["It is being worked out…", "正在计算……"], signalDone: ["Done.", "完成。"],
  bode: ["Bode plot", "伯德图"], gain: ["gain", "增益"], phase: ["phase", "相位"], lagMs: ["lag (ms)", "滞后（毫秒）"], hysteresis: ["hysteresis", "回差"], noAdvice: ["Nothing to recommend.", "没有建议。"],
  reportTitle: ["Report of commissioning", "调试报告"], reportBegan: ["begun", "开始时间"], reportNow: ["printed", "打印时间"], finished: ["finished", "完成时间"], notDone: ["not done", "未完成"], notes: ["Notes", "备注"], signature: ["Signature:", "签名："], secondPerson: ["Second person:", "复核人："],
  takeFirst: ["Take the controls first.", "请先取得控制权。"], noWebSocket: ["Waiting for the panel…", "正在等待面板……"],
  OFF: ["OFF", "关闭"], HOMING: ["HOMING", "回零"], SETTLED: ["SETTLED: people may board", "已回落：可以上下客"], RISING: ["RISING", "上升"], NEUTRAL: ["NEUTRAL", "中位"], ENGAGED: ["ENGAGED: follows the sender", "跟随发送端"], HOLD: ["HOLD", "暂停"], SETTLING: ["SETTLING", "回落中"], FAULT: ["FAULT", "故障"], ESTOP: ["E-STOP PRESSED OR LATCHED", "急停"], SERVICE: ["SERVICE: moved by hand", "检修：手动"],
  offline: ["offline", "离线"], disabled: ["no torque", "未使能"], enabling: ["enabling", "使能中"], enabled: ["torque", "已使能"], homing: ["homing", "回零中"], faulted: ["fault", "故障"], stillTorque: ["torque still on", "仍在使能"],
};
let language = store.get("heave-language") ?? (navigator.language.startsWith("zh") ? 1 : 0);
language = Number(language) === 1 ? 1 : 0;
export const chinese = () => language === 1;
export const t = (name) => TEXT[name]?.[language] ?? name;
// Why something was refused, by the panel or by heaved; null: it was not.
export const refusalOf = (got) => (chinese() ? got.error_zh : null) ?? got.error ?? (got.answer?.ok === false ? got.answer.error : null);
// Why the configuration that was applied last is not in force; "": it is.
export const putBackOf = (status) => (chinese() ? status?.configuration.put_back_zh : null) ?? status?.configuration.put_back ?? "";
// What people have to know before anything else.
export const noticesIn = (status) => [[status.estop_active, "estop"], [status.power_failing, "power"], [status.selftest.due, "due"], [status.configuration.barred, "barred"],
  [status.configuration.slow_rise, "slowRise"]].filter(([is]) => is).map(([, name]) => name);
export function switchLanguage() {
  language = 1 - language;
  store.set("heave-language", String(language));
}

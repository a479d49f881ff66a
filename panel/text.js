// SPDX-License-Identifier: MIT
// text.js - every text of the pages, in English and Chinese. A test finds one that is missing.
export const TEXT = {
  hold: ["HOLD", "停住"], holdHelp: ["Hold: stops where it is. Key: Escape", "停住：平台在原地停下。按键：Escape"],
  connected: ["connected", "已连接"], lost: ["CONNECTION LOST - buttons do nothing", "连接已断开，按钮无效"], gone: ["heaved is not running", "heaved 未运行"],
  language: ["中文", "English"], logout: ["Log out", "退出登录"],
  operate: ["Operate", "操作"], live: ["Live", "实时"], service: ["Service", "维护"], incidents: ["Incidents", "事故记录"], wall: ["All platforms", "全部平台"],
  login: ["Log in", "登录"], role: ["Role", "角色"], password: ["Password", "密码"], look: ["look", "查看"], operateRole: ["operate", "操作"], serviceRole: ["service", "维护"],
  engage: ["Start", "启动"], resume: ["Resume", "继续"], park: ["Board (park)", "上下客（停放）"], reset: ["Reset", "复位"], take: ["Take the controls", "取得控制权"], drop: ["Give the controls back", "交还控制权"],
  yours: ["You have the controls", "您拥有控制权"], nobody: ["Nobody has the controls", "无人控制"], others: ["has the controls", "拥有控制权"],
  controls: ["Controls", "控制"], intensity: ["Intensity", "强度"], apply: ["Apply", "应用"],
  sender: ["Sender", "发送方"], noSender: ["Waiting for a sender", "等待发送方"], period: ["period", "周期"], jitter: ["jitter", "抖动"], delay: ["delay", "延迟"], losses: ["lost", "丢失"], age: ["newest frame", "最新帧"],
  even: ["even in time", "时间均匀"], bursts: ["frames come in bursts", "帧成批到达"], arrivals: ["poses belong to the time of sending", "位姿对应发送时刻"],
  drives: ["Drives", "驱动器"], drive: ["drive", "驱动器"], sent: ["set-point", "设定值"], actual: ["actual", "实际值"], state: ["state", "状态"], homed: ["zero", "零点"], yes: ["found", "已找到"], no: ["not found", "未找到"],
  pose: ["Pose", "位姿"], asked: ["asked", "要求"], axis: ["axis", "轴"], relays: ["Relays", "继电器"], none: ["none", "无"], on: ["on", "接通"], unknown: ["not known", "未知"],
  bus: ["Bus", "总线"], latency: ["Cycle", "周期"], late: ["late cycles", "迟到周期"], wake: ["wake-up 99.9 %", "唤醒 99.9 %"],
  fault: ["Fault", "故障"], cause: ["Cause", "原因"], remedy: ["Remedy", "处理方法"], onAxis: ["axis", "轴"], estop: ["The e-stop is pressed", "急停已按下"], power: ["The supply is failing", "电源即将断电"],
  due: ["A self-test is due: heavectl selftest", "需要自检：heavectl selftest"], barred: ["This is not the approved configuration", "当前配置未经批准"],
  machine: ["The machine", "机器"], picture: ["The platform: drag to turn it", "平台：拖动可旋转"], ghost: ["grey: what was asked for", "灰色：要求的位姿"], atEnd: ["red: near its end", "红色：接近行程末端"],
  curves: ["Curves", "曲线"], group: ["Group", "分组"], span: ["Time", "时长"], pause: ["Pause", "暂停"], go: ["Go on", "继续显示"], rows: ["rows lost", "丢失行数"], cursor: ["at the cursor", "光标处"],
  translations: ["x, y, z: sent and actual", "x、y、z：设定与实际"], rotations: ["roll, pitch, yaw: sent and actual", "横滚、俯仰、偏航：设定与实际"], cylinders: ["Cylinders: actual", "电动缸：实际值"], errors: ["Cylinders: set-points", "电动缸：设定值"],
  spectrum: ["Spectrum of the first curve", "第一条曲线的频谱"], strongest: ["strongest", "最强"],
  enterService: ["Enter service", "进入维护"], leaveService: ["Leave service: drives off", "退出维护：驱动器断电"], torqueOn: ["Torque on, all", "全部使能"], torqueOff: ["Torque off, all", "全部去使能"],
  serviceHelp: ["With nobody on board. Hold a button to move; let go to stop.", "平台上不得有人。按住按钮运动，松开即停。"], speed: ["Speed", "速度"], homeAll: ["Home all (hold)", "全部回零（按住）"], notService: ["The machine is not in service.", "机器不在维护状态。"],
  incidentHelp: ["What the black box has written. heavectl and tools/plot read it.", "黑匣子的记录，可用 heavectl 和 tools/plot 查看。"], seen: ["I have seen them", "已查看"], dump: ["Write one now", "立即记录"], new: ["new", "新"], asDump: ["on request", "按要求"], noIncidents: ["None.", "没有记录。"],
  takeFirst: ["Take the controls first.", "请先取得控制权。"], noWebSocket: ["Waiting for the panel…", "正在等待面板……"],
  OFF: ["OFF", "关闭"], HOMING: ["HOMING", "回零"], SETTLED: ["SETTLED: people may board", "已落下：可以上下客"], RISING: ["RISING", "上升"], NEUTRAL: ["NEUTRAL", "中位"], ENGAGED: ["ENGAGED: follows the sender", "运行：跟随发送方"], HOLD: ["HOLD", "停住"], SETTLING: ["SETTLING", "下降"], FAULT: ["FAULT", "故障"], ESTOP: ["E-STOP PRESSED OR LATCHED", "急停"], SERVICE: ["SERVICE: moved by hand", "维护：手动"],
  offline: ["offline", "离线"], disabled: ["no torque", "未使能"], enabling: ["enabling", "使能中"], enabled: ["torque", "已使能"], homing: ["homing", "回零中"], faulted: ["fault", "故障"],
};
let language = localStorage.getItem("heave-language") ?? (navigator.language.startsWith("zh") ? 1 : 0);
language = Number(language) === 1 ? 1 : 0;
export const chinese = () => language === 1;
export const t = (name) => TEXT[name]?.[language] ?? name;
export function switchLanguage() {
  language = 1 - language;
  localStorage.setItem("heave-language", String(language));
}

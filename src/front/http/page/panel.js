"use strict";

const HOLD_MS = { jog: 500, move: 1000, home: 1000 }; // how long the gateway keeps one going without word from this page
const POLL_MS = 250;      // pause between two readings
const LIVE_MS = 125;      // the same while a move runs
const STALE_MS = 2000;    // values older than this are shown as old
const PATIENCE_MS = 4000; // an answer that takes longer counts as lost

const $ = (id) => document.getElementById(id);
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
const me = Array.from(crypto.getRandomValues(new Uint32Array(2)), (word) => word.toString(16)).join("");
const axes = new Map();
let polling = new AbortController();

async function ask(path, options = {}) {
  const limit = AbortSignal.timeout(PATIENCE_MS);
  const signal = options.signal ? either(options.signal, limit) : limit;
  let answer;
  try {
    answer = await fetch(path, { cache: "no-store", ...options, signal, headers: { "X-Client": me, ...options.headers } });
  } catch {
    throw new Error(limit.aborted ? "the gateway does not answer" : "no connection to the gateway");
  }
  const body = await answer.json().catch(() => null);
  if (!answer.ok) throw new Error(body?.error?.message ?? `HTTP ${answer.status}`);
  return body;
}

function either(a, b) {
  const both = new AbortController();
  for (const signal of [a, b]) signal.addEventListener("abort", () => both.abort(), { once: true });
  return both.signal;
}

const send = (axis, verb, body, method = "POST") => ask(`api/axes/${axis.name}/${verb}`, {
  method,
  keepalive: true,
  ...(body && { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } }),
});

// A stop is repeated until the gateway confirms it.
async function sendStop(axis) {
  for (let attempt = 1; ; attempt++) {
    try {
      return await send(axis, "stop");
    } catch (error) {
      if (attempt === 3) throw new Error(`stop not confirmed: ${error.message}`);
      await pause(150);
    }
  }
}

function stop(axis) {
  letGo(axis);
  return sendStop(axis);
}

async function stopAll() {
  const button = $("stop-all");
  button.classList.add("busy");
  polling.abort(); // frees its connection
  const errors = [];
  const end = (axis) => stop(axis).catch((error) => errors.push(`${axis.name}: ${error.message}`));
  await Promise.all([...axes.values()].map(end));
  if (axes.size === 0) errors.push("no axis is known yet, nothing was stopped");
  banner("failed", errors.join(" · "));
  button.classList.remove("busy");
}

const off = (button) => button.getAttribute("aria-disabled") === "true";

function press(axis, direction, button) {
  if (off(button) || axis.order) return;
  button.classList.add("held");
  begin(axis, "jog", () => ({ rpm: direction * axis.speed() }));
}

// Starts a motion, or gives the one that runs another target.
function begin(axis, verb, body) {
  tell(axis, "");
  if (!axis.order) axis.grip += 1;
  axis.order = { verb, body };
  axis.wake();
  if (!axis.driving) drive(axis);
}

function letGo(axis) {
  axis.order = null;
  axis.grip += 1;
  axis.held.forEach((button) => button.classList.remove("held"));
}

function release(axis) {
  if (axis.order) stop(axis).catch((error) => tell(axis, error.message));
}

const releaseAll = () => axes.forEach((axis) => release(axis));
const releaseJogs = () => axes.forEach((axis) => axis.order?.verb === "jog" && release(axis));

// Renews a motion: a jog while its button is held, a move while this page is looked at. Never more than one request
// under way.
async function drive(axis) {
  axis.driving = true;
  while (axis.order) {
    const { grip, order } = axis;
    const hold = HOLD_MS[order.verb];
    try {
      await send(axis, order.verb, { ...order.body(), hold_ms: hold, ...order.renewal });
      // What the gateway has ended does not begin again by itself.
      if (order.verb !== "jog") order.renewal = { renew: true };
    } catch (error) {
      if (axis.grip === grip) letGo(axis);
      tell(axis, error.message);
    }
    // Let go while the request was under way: it may have arrived after the stop.
    if (axis.grip !== grip) await sendStop(axis).catch((error) => tell(axis, error.message));
    else if (axis.order === order) await Promise.race([pause(hold / 3), new Promise((wake) => { axis.wake = wake; })]);
  }
  axis.driving = false;
}

// Axes of drive "edb": a servo drive that jogs. pid.js and cia402.js have the other kinds.
const edb = {
  build(axis) {
    const { part } = axis;
    axis.held = [part("reverse"), part("forward")];
    const [range, number] = [part("range"), part("number")];
    const limit = (value) => Math.min(Math.max(Math.round(value) || 1, 1), Number(number.max) || 1);
    axis.speed = () => limit(number.value);
    range.addEventListener("input", () => { number.value = range.value; });
    number.addEventListener("input", () => { range.value = limit(number.value); });
    number.addEventListener("change", () => { number.value = limit(number.value); });

    for (const [button, direction] of [[part("reverse"), -1], [part("forward"), 1]]) {
      button.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        button.setPointerCapture(event.pointerId);
        press(axis, direction, button);
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
        button.addEventListener(end, () => button.classList.contains("held") && release(axis));
      }
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      button.addEventListener("keydown", (event) => {
        if (event.key === "Enter" && !event.repeat) press(axis, direction, button);
      });
      button.addEventListener("keyup", (event) => event.key === "Enter" && release(axis));
    }
  },

  state(data) {
    if (data.alarm) return ["bad", `alarm ${data.alarm}`];
    if (data.jog_rpm) return ["warn", "jogging"];
    if (data.enabled) return ["good", "enabled"];
    return ["", data.enabled === false ? "disabled" : "servo unknown"];
  },

  alarm: (data) => data.alarm && `Alarm ${data.alarm}: ${data.alarm_text}`,

  show(axis, data, write) {
    const { part } = axis;
    if (part("number").max !== String(data.max_rpm)) {
      part("number").max = part("range").max = data.max_rpm;
      part("number").value = part("range").value = Math.min(100, data.max_rpm);
    }
    write("speed", figure(data.speed_rpm));
    write("jog", figure(data.jog_rpm));
    write("torque", figure(data.torque_percent));
    write("position", figure(data.position_pulses));
    const share = Math.max(-1, Math.min(1, (data.speed_rpm ?? 0) / data.max_rpm));
    part("bar").style.transform = `scaleX(${share})`;
    write("flags", data.status === null ? "" : [`${data.status}h`, ...data.flags].join(" "));
    for (const button of axis.held) button.setAttribute("aria-disabled", data.enabled === false || !data.online);
  },

  hear() {},
  draw() {},
};

const kinds = { edb, pid, cia402 };

function build({ name, drive }) {
  const card = $("axis").content.firstElementChild.cloneNode(true);
  const part = (key) => card.querySelector(`[data-${key}]`);
  const axis = { name, card, part, kind: kinds[drive], order: null, grip: 0, driving: false, wake() {}, held: [], trouble: "", last: null };
  for (const other of Object.keys(kinds)) {
    if (other !== drive) card.querySelectorAll(`.${other}`).forEach((element) => element.remove());
  }
  card.setAttribute("aria-label", `axis ${name}`);
  part("name").textContent = name;
  axis.kind.build(axis);
  const act = (key, action) => part(key).addEventListener("click", () => {
    tell(axis, "");
    action().catch((error) => tell(axis, error.message));
  });
  act("stop", () => stop(axis));
  for (const verb of ["enable", "disable", "clear"]) {
    act(verb, () => {
      release(axis);
      return send(axis, verb);
    });
  }
  $("axes").append(card);
  return axis;
}

const age = (ms) => ms < 10_000 ? `${(ms / 1000).toFixed(1)} s` : ms < 120_000 ? `${Math.round(ms / 1000)} s` : `${Math.round(ms / 60_000)} min`;
const figure = (value) => value == null ? "–" : String(value).replace("-", "−").replace(/\B(?=(\d{3})+$)/g, "\u2009");

function tell(axis, text) {
  axis.trouble = text;
  if (axis.last) show(axis, axis.last);
}

function notes(axis, data, alarm) {
  const { event, error, lease } = data;
  const texts = [];
  if (axis.trouble) texts.push(axis.trouble);
  if (alarm) texts.push(alarm);
  if (error) texts.push(error.message);
  if (event) texts.push(`${event.cause.replaceAll("-", " ")}, ${age(event.age_ms)} ago (${event.holder})`);
  if (lease && !axis.order && !texts.length) texts.push(`${lease.holder} commands this axis`);
  return texts.map((text) => text[0].toUpperCase() + text.slice(1)).join(". ");
}

function show(axis, data) {
  const { part, card, kind } = axis;
  const write = (key, text) => { if (part(key).textContent !== text) part(key).textContent = text; };
  axis.last = data;
  kind.show(axis, data, write);
  write("where", `${data.drive.toUpperCase()} · bus ${data.bus} · address ${data.address}`);
  const [mood, word] = data.online ? kind.state(data) : ["bad", "offline"];
  part("state").className = `state ${mood}`;
  write("state", word);
  write("age", data.age_ms === null ? "never read" : `${age(data.age_ms)} ago`);
  card.classList.toggle("stale", data.age_ms === null || (data.age_ms > STALE_MS && !kind.reportsChanges) || !data.online);
  const alarm = kind.alarm(data);
  const text = notes(axis, data, alarm);
  part("note").hidden = !text;
  part("note").classList.toggle("bad", Boolean(axis.trouble || alarm || data.error));
  part("clear").hidden = !(alarm || data.event);
  write("text", text);
  part("enable").setAttribute("aria-pressed", data.enabled === true);
  part("disable").setAttribute("aria-pressed", data.enabled === false);
}

const time = (us) => us == null ? "–" : `${(us / 1000).toFixed(us < 10_000 ? 2 : 1)} ms`;
const modbus = {
  "Requests": (s) => s.submitted, "Confirmed": (s) => s.confirmed, "No reply": (s) => s.no_reply,
  "Not sent": (s) => s.expired + s.rested + s.stopped + s.line_down + s.queue_full, "Exceptions": (s) => s.exceptions,
  "Mean latency": (s) => time(s.latency_mean_us), "Waiting": (s) => s.waiting, "Resting": (s) => s.resting,
};
const framed = {
  "Cycles": (s) => s.cycles, "Failed": (s) => s.failed, "Overruns": (s) => s.overruns, "Reports missed": (s) => s.missed,
  "Last cycle": (s) => time(s.last_cycle_us), "Longest cycle": (s) => time(s.longest_cycle_us),
  "Collisions": (s) => s.line.collisions, "Given up": (s) => s.line.losses,
};

const canopen = {
  "State": (s) => s.state, "Load, %": (s) => String(s.load_percent), "Received": (s) => s.received, "Sent": (s) => s.sent,
  "Booted": (s) => s.booted, "Emergencies": (s) => s.emergencies, "SDO": (s) => s.sdo.transfers, "Aborted": (s) => s.sdo.aborted,
};

// A table for each kind of bus.
function showBuses(buses) {
  $("buses").replaceChildren(...[modbus, framed, canopen].map((columns) => {
    const table = document.createElement("table");
    const add = (row, tag, text, number) => {
      const cell = row.appendChild(document.createElement(tag));
      cell.textContent = text;
      cell.className = number ? "n" : "";
      return cell;
    };
    const head = table.createTHead().insertRow();
    ["Bus", "Protocol", "Line", ...Object.keys(columns)].forEach((title, index) => { add(head, "th", title, index > 2).scope = "col"; });
    for (const bus of buses.filter(({ protocol }) => ({ framed, canopen }[protocol] ?? modbus) === columns)) {
      const row = table.insertRow();
      [bus.name, bus.protocol, `${bus.port} ${bus.bitrate ?? `${bus.baud} ${bus.format}`}`].forEach((text) => add(row, "td", text));
      for (const [title, value] of Object.entries(columns)) {
        const count = value(bus.statistics);
        const cell = add(row, "td", typeof count === "number" ? figure(count) : count, true);
        if (title === "Resting" && count) cell.classList.add("hot");
      }
    }
    return table;
  }).filter((table) => table.rows.length > 1));
  readNodes(buses).catch((error) => { if (!polling.signal.aborted) banner("failed", error.message); });
}

function showSystem({ version, commit, uptime_ms, reset }) {
  const up = uptime_ms < 7_200_000 ? age(uptime_ms) : `${Math.round(uptime_ms / 3_600_000)} h`;
  const after = reset && reset !== "power-on" ? `, started after ${reset}` : "";
  $("system").textContent = `puente ${version} (${commit}), up ${up}${after}`;
}

// Axes that go through the same stages together, until they have come to the end.
function showGroup(group) {
  const goes = group && !group.failed && group.stage !== "done";
  banner("group", goes ? `Group ${group.axes.join(", ")}: ${group.stage}, waits for ${group.awaits.join(", ")}` : "");
}

function banner(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
  $(id).hidden = !text;
}

// Network settings that nobody confirms are taken back.
function showTrial({ trial_left_s: left }) {
  $("trial").hidden = left === null;
  if (left !== null) $("trial-text").textContent = `New network settings, on trial: in ${left} s the gateway takes them back.`;
}

function keep() {
  ask("api/config/confirm", { method: "POST" }).then(showTrial).catch((error) => banner("failed", error.message));
}

function link(mood, text) {
  $("link").className = `link ${mood}`;
  if ($("link").textContent !== text) $("link").textContent = text;
}

async function read() {
  const list = await ask("api/axes", { signal: polling.signal });
  for (const [name, axis] of axes) {
    if (!list.some((data) => data.name === name && kinds[data.drive] === axis.kind)) {
      axis.card.remove();
      axes.delete(name);
    }
  }
  for (const data of list) {
    if (!axes.has(data.name)) axes.set(data.name, build(data));
    const axis = axes.get(data.name);
    axis.kind.hear(axis, data);
    show(axis, data);
  }
}

const moves = () => [...axes.values()].some((axis) => axis.last?.state === "following" || axis.last?.progress === "running");

async function watch() {
  const others = [
    { path: "api/system", show: showSystem, every: 10_000, due: 0 },
    { path: "api/group", show: showGroup, every: 1000, due: 250 },
    { path: "api/buses", show: showBuses, every: 1000, due: 0 },
    { path: "api/config/state", show: showTrial, every: 1000, due: 500 },
  ];
  let since = "";
  for (;;) {
    if (document.hidden) await new Promise((shown) => document.addEventListener("visibilitychange", shown, { once: true }));
    if (polling.signal.aborted) polling = new AbortController();
    try {
      await read();
      for (const other of others) {
        if (performance.now() < other.due) continue;
        other.due = performance.now() + other.every;
        other.show(await ask(other.path, { signal: polling.signal }));
      }
      since = "";
      banner("lost", "");
      link("up", location.host);
      await pause(moves() ? LIVE_MS : POLL_MS);
    } catch (error) {
      if (polling.signal.aborted) continue;
      since ||= new Date().toLocaleTimeString();
      banner("lost", `Connection lost at ${since}: ${error.message}. The values are old. The gateway ends a jog ${HOLD_MS.jog} ms, a move ${HOLD_MS.move} ms after its last word from this page.`);
      link("down", "no connection");
      axes.forEach((axis) => {
        axis.card.classList.add("stale");
        axis.kind.draw(axis);
      });
      await pause(1000);
    }
  }
}

const isStop = (event) => event.key === "Escape" || event.key === " ";
addEventListener("keydown", (event) => {
  if (!isStop(event)) return;
  event.preventDefault();
  if (!event.repeat) stopAll();
}, true);
addEventListener("keyup", (event) => isStop(event) && event.preventDefault(), true);
addEventListener("blur", releaseJogs);
addEventListener("pagehide", releaseAll);
document.addEventListener("visibilitychange", () => document.hidden && releaseAll());
$("stop-all").addEventListener("click", stopAll);
$("keep").addEventListener("click", keep);
watch();

"use strict";

// Axes of drive "pid": a position loop with a live plot. panel.js has what all axes share.

const SPAN_MS = 10_000;   // what the plot shows
const SAME_MS = 20;       // values of one reading and the next that are no further apart are the same
const NEAR = 10;          // counts: so far from its target friction may hold an axis
const SETTLED_MS = 2000;  // one that stands there for so long has arrived

const pid = {
  build(axis) {
    const { part } = axis;
    const [move, gains] = [part("move"), part("gains")];
    axis.trace = [];
    const form = (element, action) => element.addEventListener("submit", (event) => {
      event.preventDefault();
      action();
    });
    form(move, () => {
      if (off(part("go"))) return;
      const position = move.target.valueAsNumber;
      begin(axis, "move", () => ({ position }));
    });
    form(gains, () => {
      const body = Object.fromEntries(["kp", "ki", "kd"].map((name) => [name, gains[name].valueAsNumber]));
      tell(axis, "");
      send(axis, "gains", body, "PUT").then(() => gains.classList.remove("edited")).catch((error) => tell(axis, error.message));
    });
    gains.addEventListener("input", () => gains.classList.add("edited"));
  },

  state({ state }) {
    const moods = { following: "warn", starting: "warn", held: "good", fault: "bad" };
    return [moods[state] ?? "", state ?? "state unknown"];
  },

  alarm: (data) => data.fault && `Fault: ${data.fault}`,

  show(axis, data, write) {
    const { part } = axis;
    write("position", figure(data.position));
    write("setpoint", figure(wish(data)));
    write("lag", figure(minus(data.reference, data.position)));
    write("velocity", decimal(data.velocity, 0));
    write("command", decimal(data.command_percent, 1));
    part("go").setAttribute("aria-disabled", data.enabled !== true || !data.online);
    part("go").classList.toggle("held", Boolean(axis.order));
    if (!part("gains").matches(".edited, :focus-within")) {
      for (const name of ["kp", "ki", "kd"]) part("gains")[name].value = data.gains?.[name] ?? "";
    }
    pid.draw(axis);
  },

  hear(axis, data) {
    const { target } = axis.part("move");
    if (axis.last?.position == null && !target.value) target.value = data.position ?? "";
    record(axis.trace, data);
    endArrived(axis, data);
  },

  draw(axis) {
    const now = performance.now();
    while (axis.trace[1]?.at < now - SPAN_MS) axis.trace.shift();
    const values = axis.trace.flatMap(({ position, goal }) => [position, goal]).filter((value) => value !== null);
    const [low, high] = limits(values);
    const x = (at) => Math.round(1000 - (now - at) * 1000 / SPAN_MS);
    const y = (value) => Math.round((high - value) * 1000 / (high - low));
    let [is, wished, before] = ["", "", {}];
    for (const { at, position, goal } of axis.trace) {
      if (position !== null) is += `${before.position == null ? "M" : "L"}${x(at)} ${y(position)}`;
      if (goal !== null) wished += before.goal == null ? `M${x(at)} ${y(goal)}` : `V${y(goal)}H${x(at)}`;
      before = { position, goal };
    }
    axis.part("is").setAttribute("d", is);
    axis.part("wish").setAttribute("d", wished);
    grid(axis, low, high, y);
  },
};

const minus = (a, b) => a === null || b === null ? null : a - b;
// With no sign before a zero.
const decimal = (value, digits) => figure(value === null ? null : (Number(value.toFixed(digits)) || 0).toFixed(digits));

// Where the axis is to be: its target, or else what it holds.
const wish = ({ state, set_point: target, reference }) =>
  ({ following: target, starting: reference, held: reference })[state] ?? null;

// A sample of the plot; none while the module is not heard, which leaves a gap.
function record(trace, data) {
  const now = performance.now();
  const last = trace.at(-1)?.at ?? 0;
  const at = data.online ? now - data.age_ms : now;
  if (at - last > STALE_MS) trace.push({ at: last, position: null, goal: null });
  if (at - last > SAME_MS) trace.push({ at, position: data.online ? data.position : null, goal: data.online ? wish(data) : null });
}

// Room around the values, and never so near that the noise of one count looks like motion.
function limits(values) {
  if (!values.length) return [-12, 12];
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = Math.max((high - low) * 0.08, 12 - (high - low) / 2);
  return [low - room, high + room];
}

function grid(axis, low, high, y) {
  const decade = 10 ** Math.floor(Math.log10((high - low) / 5));
  const step = [1, 2, 5, 10].map((factor) => factor * decade).find((size) => (high - low) / size <= 5);
  const ticks = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) ticks.push(value);
  axis.part("grid").setAttribute("d", ticks.map((value) => `M0 ${y(value)}H1000`).join(""));
  axis.part("ticks").replaceChildren(...ticks.map((value) => {
    const label = document.createElement("span");
    label.textContent = figure(value);
    label.style.top = `${y(value) / 10}%`;
    return label;
  }));
}

// A move that has arrived is ended, so that others may command the axis: it stays where it stands.
function endArrived(axis, { state, position, reference, set_point: target }) {
  const near = axis.order?.body().position === target && state === "following" && reference === target
    && Math.abs(position - target) <= NEAR;
  const now = performance.now();
  if (!near) axis.stands = null;
  else if (!axis.stands || Math.abs(position - axis.stands.position) > 1) axis.stands = { position, since: now };
  else if (now - axis.stands.since >= SETTLED_MS) release(axis);
}

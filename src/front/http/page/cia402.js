"use strict";

// Axes of drive "cia402": a servo drive on a CANopen bus. panel.js has what all axes share.

const cia402 = {
  reportsChanges: true, // while its node is there, what it last said is so

  build(axis) {
    const { part } = axis;
    const move = part("move");
    move.addEventListener("submit", (event) => {
      event.preventDefault();
      if (off(part("go"))) return;
      const position = move.target.valueAsNumber;
      begin(axis, "move", () => ({ position }));
    });
    part("home").addEventListener("click", () => off(part("home")) || begin(axis, "home", () => ({})));
  },

  state({ state, node }) {
    if (node !== "present") return ["bad", node ?? "unknown"];
    const moods = { "operation-enabled": "good", "quick-stop-active": "warn", "fault-reaction-active": "bad", fault: "bad" };
    return [moods[state] ?? "", state?.replaceAll("-", " ") ?? "unknown"];
  },

  alarm: (data) => data.state === "fault" ? `Fault ${data.fault ?? ""} ${data.emergency ?? ""}`
    : data.failure ?? (data.node === "refused" ? data.node_text : null),

  show(axis, data, write) {
    const { part } = axis;
    write("position", figure(data.position));
    write("setpoint", figure(data.set_point));
    write("velocity", figure(data.velocity));
    write("mode", data.mode ?? "–");
    write("homed", data.homed === null ? "–" : data.homed ? "yes" : "no");
    write("flags", data.status === null ? "" : `${data.status}h ${data.progress}`);
    for (const key of ["go", "home"]) {
      part(key).setAttribute("aria-disabled", data.enabled !== true);
      part(key).classList.toggle("held", axis.order?.verb === (key === "go" ? "move" : key));
    }
  },

  // What has arrived is held by the gateway, and needs this page no more.
  hear(axis, data) {
    if (axis.order?.renewal && data.lease === null) axis.order = null;
  },

  draw() {},
};

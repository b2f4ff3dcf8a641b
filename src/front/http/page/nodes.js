"use strict";

// Nodes of CANopen buses: their state and last emergency, and their objects. panel.js has what the page shares.

const nodeMoods = { booted: "", booting: "hot", absent: "hot", lost: "hot", refused: "hot" };

// Reads the nodes of all CANopen buses, one bus after the other.
async function readNodes(buses) {
  const rows = [];
  for (const { name, protocol } of buses) {
    if (protocol !== "canopen") continue;
    const nodes = await ask(`api/buses/${name}/nodes`, { signal: polling.signal });
    rows.push(...nodes.map((node) => ({ bus: name, ...node })));
  }
  showNodes(rows);
}

function showNodes(rows) {
  $("nodes-part").hidden = !rows.length;
  const table = document.createElement("table");
  const head = table.createTHead().insertRow();
  const cell = (row, tag, text, mood = "") => {
    const made = row.appendChild(document.createElement(tag));
    made.textContent = text;
    made.className = mood;
  };
  for (const title of ["Bus", "Node", "Name", "State", "Health", "Emergency", "Heard"]) cell(head, "th", title);
  for (const node of rows) {
    const row = table.insertRow();
    const { emergency } = node;
    const health = [node.health, node.verdict, node.duplicate && "node-ID given twice"].filter(Boolean).join(": ");
    for (const text of [node.bus, node.node, node.axis ?? node.name ?? "–", node.state ?? "–"]) cell(row, "td", text);
    cell(row, "td", health, nodeMoods[node.health]);
    cell(row, "td", emergency ? `${emergency.code} ${emergency.text}` : "–", emergency ? "hot" : "");
    cell(row, "td", node.heard_ms === null ? "never" : `${age(node.heard_ms)} ago`);
  }
  $("nodes").replaceChildren(table);
  const choice = $("object").elements.node;
  const names = rows.map(({ bus, node }) => `${bus}/nodes/${node}`);
  if ([...choice.options].map((option) => option.value).join() === names.join()) return;
  choice.replaceChildren(...rows.map(({ bus, node }, index) => new Option(`${bus} ${node}`, names[index])));
}

// A number where it looks like one, else text.
const objectValue = (text) => /^-?\d+(\.\d+)?$/.test(text) ? Number(text) : text;

$("object").addEventListener("submit", (event) => {
  event.preventDefault();
  const { node, object, type, value } = event.target.elements;
  const path = `api/buses/${node.value}/objects/${object.value}${type.value && `/${type.value}`}`;
  const writes = event.submitter?.value === "write";
  const options = writes ? { method: "PUT", body: JSON.stringify({ value: objectValue(value.value) }) } : {};
  const said = $("object-said");
  ask(path, options).then((answer) => {
    const name = [answer.object, answer.name].filter(Boolean).join(", ");
    said.textContent = [writes ? "written" : `${answer.value} (${answer.type})`, name].filter(Boolean).join(" · ");
    said.className = "";
  }).catch((error) => {
    said.textContent = error.message;
    said.className = "bad";
  });
});

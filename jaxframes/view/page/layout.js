/* Where every row lies: from left to right as a tree, or as an indented list. */

const FONT = '13px system-ui, "Segoe UI", sans-serif';
const PILL = 21; // height of a pill
const STEP = 27; // from one row to the next
const GAP = 46; // between columns
const BETWEEN = 8; // between stacks
const GLIDE = 350; // milliseconds

let rows = [];
let places = new Map(); // row -> [x, y] of the left end of its pill, and its middle
let before = new Map(); // where rows were when the layout last changed
let changedAt = -GLIDE;
let widths = new Map();
let folded = false; // whether runs of only children are stacks

const mode = () => byId("mode").value;
const suffixed = (row) => row >= 0 && children[row].length > 0 && !open.has(row);

/** The text in a pill: control and direction marks as dots, long ones cut. */
function pillText(row) {
  if (row < 0) return `${hiddenBelow(parentOf(row))} more`;
  return cut(printable(tree.labels[row]), 32);
}

function widthOf(row) {
  const text = pillText(row);
  if (!widths.has(text)) {
    pen.font = FONT;
    widths.set(text, pen.measureText(text).width + 18);
  }
  return widths.get(text);
}

/** The width that a row takes in its column, its "+n" included. */
const roomOf = (row) => widthOf(row) + (suffixed(row) ? 48 : 0);

/** Lay all rows out anew; the row given, where there is one, stays where it is and everything else moves around it. */
function layout(anchor) {
  rows = allRows();
  const next = mode() === "outline" ? outline() : tidy();
  if (anchor !== undefined && places.has(anchor) && next.has(anchor)) {
    const [x, y] = places.get(anchor);
    const [nx, ny] = next.get(anchor);
    for (const place of next.values()) {
      place[0] += x - nx;
      place[1] += y - ny;
    }
  }
  before = new Map(rows.map((row) => [row, startOf(row, next)]));
  places = next;
  changedAt = performance.now();
  draw();
}

/** Where a row's glide starts: where it was, or where the nearest row above it was. */
function startOf(row, next) {
  for (let at = row; at !== -1; at = parentOf(at)) {
    if (places.has(at)) return places.get(at);
  }
  return next.get(row);
}

function outline() {
  const depth = new Map();
  const found = new Map();
  rows.forEach((row, i) => {
    depth.set(row, row === 0 ? 0 : depth.get(parentOf(row)) + 1);
    found.set(row, [depth.get(row) * 24, i * (STEP - 3)]);
  });
  return found;
}

/** Left to right, parents beside the middle of their children; where that is too wide, runs of only children become stacks. */
function tidy() {
  const depth = new Map();
  const columns = [];
  for (const row of rows) {
    const d = row === 0 ? 0 : depth.get(parentOf(row)) + 1;
    depth.set(row, d);
    columns[d] = Math.max(columns[d] ?? 0, roomOf(row));
  }
  folded = columns.reduce((total, width) => total + width + GAP, 0) > 1.1 * canvas.clientWidth;
  return stacks(folded);
}

/** The layout whose units are stacks: runs of only children if these fold, else single rows. */
function stacks(fold) {
  const head = new Map(); // the first row of each row's stack
  const members = new Map(); // stack by its first row
  const column = new Map();
  for (const row of rows) {
    const parent = row === 0 ? -1 : parentOf(row);
    if (fold && row !== 0 && rowsBelow(parent).length === 1) {
      head.set(row, head.get(parent));
      members.get(head.get(row)).push(row);
    } else {
      head.set(row, row);
      members.set(row, [row]);
      column.set(row, row === 0 ? 0 : column.get(head.get(parent)) + 1);
    }
  }
  const widest = [];
  for (const [first, stack] of members) {
    const c = column.get(first);
    for (const row of stack) widest[c] = Math.max(widest[c] ?? 0, roomOf(row));
  }
  const left = [0];
  widest.forEach((width, c) => left.push(left[c] + width + GAP));

  const firsts = [...members.keys()];
  const after = (first) => rowsBelow(members.get(first).at(-1));
  const heights = new Map();
  const total = (first) => after(first).reduce((sum, row) => sum + heights.get(row), 0);
  const padding = fold ? BETWEEN : 0;
  for (const first of firsts.slice().reverse()) {
    heights.set(first, Math.max(members.get(first).length * STEP + padding, total(first)));
  }
  const found = new Map();
  const top = new Map([[0, 0]]);
  for (const first of firsts) {
    const [start, height, stack] = [top.get(first), heights.get(first), members.get(first)];
    let y = start + (height - total(first)) / 2;
    for (const row of after(first)) {
      top.set(row, y);
      y += heights.get(row);
    }
    const middle = start + (height - (stack.length - 1) * STEP) / 2;
    stack.forEach((row, i) => found.set(row, [left[column.get(first)], middle + i * STEP]));
  }
  return found;
}

/** Where a row is drawn now: on its way from where it was to where it belongs. */
function placeNow(row, now) {
  const to = places.get(row);
  const f = Math.min(1, (now - changedAt) / GLIDE);
  if (f >= 1) return to;
  const from = before.get(row) ?? to;
  const eased = f * f * (3 - 2 * f);
  return [from[0] + (to[0] - from[0]) * eased, from[1] + (to[1] - from[1]) * eased];
}

/** The box around all pills: left, top, right, bottom. */
function extent() {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const row of rows) {
    const [x, y] = places.get(row);
    box[0] = Math.min(box[0], x);
    box[1] = Math.min(box[1], y - PILL / 2);
    box[2] = Math.max(box[2], x + roomOf(row));
    box[3] = Math.max(box[3], y + PILL / 2);
  }
  return box;
}

/* What a reader does: clicks, keys, search, and the controls at the top. */

/** Choose the frame asked about and, or -1, its observer. */
function choose(frame, relativeTo) {
  chosen = frame;
  observer = relativeTo;
  path = new Set(frame < 0 ? [] : relativeTo < 0 ? lineOf(frame) : route(frame, relativeTo).path);
  fillPanel();
  draw();
}

/** Open the way to a frame, show it and choose it alone. */
function select(frame) {
  if (openTheWay(frame)) layout(nearest());
  showRow(frame);
  choose(frame, -1);
}

/** The row that stays where it is while others move: the one asked about if it is shown, else the one nearest to the middle. */
function nearest(but = []) {
  const near = (row) => Math.abs(places.get(row)[1] * view.zoom + view.y) < 2 * canvas.clientHeight;
  const inside = (row) => row >= 0 && places.has(row) && !but.includes(row) && near(row);
  if (inside(chosen)) return chosen;
  const [x, y] = [(canvas.clientWidth / 2 - view.x) / view.zoom, (canvas.clientHeight / 2 - view.y) / view.zoom];
  let [best, least] = [0, Infinity];
  for (const [row, [px, py]] of places) {
    const far = Math.hypot(px - x, py - y);
    if (row >= 0 && far < least && !but.includes(row)) [best, least] = [row, far];
  }
  return best;
}

/** Open a subtree by some frames, or close it; its pill stays under the pointer. */
function toggle(frame) {
  if (!children[frame].length) return;
  if (!open.delete(frame)) openSome(frame, 25);
  layout(frame);
}

/** Show more of the many children of a frame. */
function showMore(row) {
  const parent = parentOf(row);
  few.set(parent, (few.get(parent) ?? FEW) + 100);
  layout(parent);
}

/** Only a subtree and its line to the root. */
function showOnly(frame) {
  open = new Set();
  openTheWay(frame);
  openSome(frame, 60);
  layout();
  fit();
  choose(frame, -1);
}

/** The row at a point of the canvas, and whether the point is on its "+n". */
function rowAt(x, y) {
  const [px, py] = [(x - view.x) / view.zoom, (y - view.y) / view.zoom];
  const reach = Math.max(PILL / 2, 5 / view.zoom);
  for (const row of rows) {
    const [rx, ry] = places.get(row);
    if (Math.abs(py - ry) > reach || px < rx) continue;
    if (px <= rx + widthOf(row)) return [row, false];
    if (row >= 0 && children[row].length && px < rx + widthOf(row) + 46) return [row, true];
  }
  return [-1, false];
}

function clicked(x, y) {
  const [row, onCount] = rowAt(x, y);
  if (row === -1) choose(-1, -1);
  else if (row < 0) showMore(row);
  else if (onCount) toggle(row);
  else if (chosen < 0 || observer >= 0) choose(row, -1);
  else if (row === chosen) choose(-1, -1);
  else choose(chosen, row);
}

const pointers = new Map();
let dragged = 0;

canvas.onpointerdown = (event) => {
  if (!pointers.size) dragged = 0;
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  canvas.setPointerCapture(event.pointerId);
  byId("tip").hidden = true;
};

canvas.onpointermove = (event) => {
  const [x, y] = [event.offsetX, event.offsetY];
  const last = pointers.get(event.pointerId);
  if (!last) {
    const [row] = rowAt(x, y);
    canvas.style.cursor = row === -1 ? "grab" : "pointer";
    if (row !== hovered) {
      hovered = row;
      draw();
    }
    showTip(row, x, y);
    return;
  }
  dragged += Math.abs(x - last[0]) + Math.abs(y - last[1]);
  if (pointers.size === 1) {
    view.x += x - last[0];
    view.y += y - last[1];
  } else {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
    const apart = (point) => Math.max(20, Math.hypot(point[0] - other[0], point[1] - other[1]));
    zoomAt(other[0], other[1], apart([x, y]) / apart(last));
  }
  pointers.set(event.pointerId, [x, y]);
  draw();
};

canvas.onpointerup = (event) => {
  pointers.delete(event.pointerId);
  if (dragged <= 4 && event.button === 0) clicked(event.offsetX, event.offsetY);
};
canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
canvas.onpointerleave = () => {
  hovered = -1;
  showTip(-1);
  draw();
};

canvas.ondblclick = (event) => {
  const [row, onCount] = rowAt(event.offsetX, event.offsetY);
  if (row >= 0 && !onCount) showOnly(row);
};

/** Zoom by a factor about a point of the canvas. */
function zoomAt(x, y, factor) {
  const zoom = Math.min(4, Math.max(0.02, view.zoom * factor));
  view.x = x - ((x - view.x) * zoom) / view.zoom;
  view.y = y - ((y - view.y) * zoom) / view.zoom;
  view.zoom = zoom;
  draw();
}

canvas.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    zoomAt(event.offsetX, event.offsetY, Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
  },
  { passive: false },
);

/* ---- search ---- */

let found = [];
let nextHit = 0;

function search() {
  const text = byId("search").value.trim();
  let matches = (name) => name.toLowerCase().includes(text.toLowerCase());
  let remark = "";
  if (text.startsWith("~")) {
    try {
      const expression = new RegExp(text.slice(1), "iu");
      matches = (name) => expression.test(name);
    } catch {
      matches = () => false;
      remark = "not a regular expression";
    }
  }
  const all = tree.names.map((_, i) => i);
  found = text && text !== "~" ? all.filter((i) => matches(tree.names[i]) || matches(tree.labels[i])) : [];
  found.sort((a, b) => tree.names[a].length - tree.names[b].length || a - b);
  hits = new Set(found);
  nextHit = 0;
  byId("count").textContent = remark || (text ? `${found.length} found` : countText());
  if (found.length) {
    if (openTheWay(found[0])) layout(nearest());
    showRow(found[0]);
  }
  draw();
}

const countText = () => `${tree.names.length} ${tree.names.length === 1 ? "frame" : "frames"}`;

byId("search").oninput = search;
byId("search").onkeydown = (event) => {
  if (event.key === "Enter" && found.length) {
    const at = nextHit++ % found.length;
    select(found[at]);
    byId("count").textContent = `${at + 1} of ${found.length}`;
  }
  if (event.key === "Escape") {
    byId("search").value = "";
    search();
    canvas.focus();
  }
};

/* ---- keys ---- */

/** The frame that an arrow key leads to. */
function neighbour(frame, key) {
  if (key === "ArrowLeft") return frame ? tree.parents[frame] : 0;
  if (key === "ArrowRight") {
    if (children[frame].length && !open.has(frame)) toggle(frame);
    return rowsBelow(frame)[0] ?? frame;
  }
  const shown = rows.filter((row) => row >= 0);
  const column = mode() === "outline" ? shown : shown.filter((row) => Math.abs(places.get(row)[0] - places.get(frame)[0]) < 1);
  column.sort((a, b) => places.get(a)[1] - places.get(b)[1]);
  const step = key === "ArrowDown" ? 1 : -1;
  return column[column.indexOf(frame) + step] ?? frame;
}

function pressed(event) {
  const typing = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
  if (typing || !tree || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "/") {
    event.preventDefault();
    byId("search").focus();
  } else if (event.key === "Escape") choose(-1, -1);
  else if (event.key === "f") fit(true);
  else if (event.target instanceof HTMLButtonElement) return;
  else if (event.key.startsWith("Arrow")) {
    event.preventDefault();
    moveBy(event.key);
  } else if (event.key === "Enter" && chosen >= 0) {
    toggle(observer >= 0 ? observer : chosen);
  } else if (event.key === " " && chosen >= 0) {
    event.preventDefault();
    choose(chosen, observer >= 0 ? -1 : chosen ? tree.parents[chosen] : 0);
  }
}

/** Move the frame asked about, or the observer where there is one. */
function moveBy(key) {
  const at = observer >= 0 ? observer : chosen;
  const to = at < 0 || !places.has(at) ? 0 : neighbour(at, key);
  if (openTheWay(to)) layout(nearest());
  showRow(to);
  if (observer >= 0) choose(chosen, to);
  else choose(to, -1);
}

addEventListener("keydown", pressed);

/* ---- the controls at the top ---- */

byId("fit").onclick = () => fit(true);
byId("collapse").onclick = () => {
  open = new Set([0]);
  few = new Map();
  wanted = new Map();
  if (children[0].length === 1) openSome(0, 8);
  layout();
  fit();
};
byId("expand").onclick = () => {
  for (let level = 0; level < 2; level++) {
    for (const row of allRows().slice(0, 3000)) if (suffixed(row)) open.add(row);
  }
  layout(nearest());
};
byId("mode").onchange = () => {
  layout();
  fit();
};
byId("coloring").onchange = () => {
  fillLegend();
  draw();
};
new ResizeObserver(draw).observe(byId("stage"));
matchMedia("(prefers-color-scheme: dark)").onchange = () => {
  readLook();
  if (tree) fillLegend();
  draw();
};

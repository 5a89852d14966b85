/* Drawing: edges, chains, pills. Text goes through fillText and textContent only, never through markup. */

// Colours that most colour-blind readers tell apart (Okabe and Ito 2008), and a few more.
const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#7a5195", "#6b7280", "#a3333d", "#2f8f9d"];
const LEGIBLE = 0.42; // below this zoom pills are bars
const FLASH = 1600; // milliseconds

const byId = (id) => document.getElementById(id);
const canvas = byId("canvas");
const counts = document.body.dataset; // what has been shown how often, for tests
const pen = canvas.getContext("2d");
const view = { zoom: 1, x: 20, y: 0 };
let chosen = -1; // the frame asked about
let observer = -1;
let hovered = -1;
let hits = new Set();
let path = new Set();
let faded = new Set(); // kinds
let flashes = new Map(); // row -> when it began to flash
let look = {};
let waiting = 0;

const UNSEEN = /[\u0000-\u001f\u007f-\u009f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]/g;
const printable = (text) => text.replace(UNSEEN, "\u00b7");
function cut(text, most) {
  const letters = Array.from(text);
  return letters.length > most ? letters.slice(0, most - 1).join("") + "\u2026" : text;
}

/** Read the colours of the style sheet, which follow the reader's light or dark setting. */
function readLook() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ground", "text", "dim", "card", "hit", "chosen", "observer", "wrong"]) {
    look[name] = style.getPropertyValue("--" + name).trim();
  }
}

/** How many edges meet at a frame. */
const valency = (frame) => children[frame].length + (frame ? 1 : 0);
const valencyColour = (count) => `hsl(${Math.max(0, 247 - 40 * Math.min(count, 6))} 68% 48%)`;
const kindColour = (kind) => PALETTE[kind % PALETTE.length];

function colourOf(row) {
  if (row < 0) return look.dim;
  if (byId("coloring").value === "valency") return valencyColour(valency(row));
  return row ? kindColour(tree.kinds[row]) : look.dim;
}

function opacityOf(row) {
  if (row > 0 && faded.has(tree.kinds[row])) return 0.14;
  return path.size && !path.has(row) ? 0.5 : 1;
}

/** Ask for a picture; however often, the next one shows everything. */
function draw() {
  if (!waiting) waiting = requestAnimationFrame(paint);
}

function paint() {
  waiting = 0;
  if (!tree) return;
  const now = performance.now();
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = look.ground;
  pen.fillRect(0, 0, width, height);
  pen.setTransform(ratio * view.zoom, 0, 0, ratio * view.zoom, ratio * view.x, ratio * view.y);

  const at = new Map(rows.map((row) => [row, placeNow(row, now)]));
  const seen = {
    left: (-700 - view.x) / view.zoom,
    right: (width + 50 - view.x) / view.zoom,
    top: (-30 - view.y) / view.zoom,
    bottom: (height + 30 - view.y) / view.zoom,
  };
  drawEdges(at, seen);
  drawChains(at);
  drawPills(at, seen, now);
  counts.painting = (performance.now() - now).toFixed(2);
  if (now - changedAt < GLIDE || flashes.size) draw();
}

function drawEdges(at, seen) {
  for (const row of rows) {
    if (row === 0) continue;
    const parent = parentOf(row);
    const [a, b] = [at.get(parent), at.get(row)];
    const hot = path.has(row) && path.has(parent);
    const out = Math.max(a[1], b[1]) < seen.top || Math.min(a[1], b[1]) > seen.bottom;
    if (!hot && (out || b[0] < seen.left || a[0] > seen.right)) continue;
    pen.globalAlpha = hot ? 1 : path.size ? 0.28 : Math.min(0.75, opacityOf(row));
    pen.strokeStyle = hot ? look.chosen : colourOf(row);
    pen.lineWidth = Math.max(hot ? 3 : 1.5, 0.7 / view.zoom);
    pen.beginPath();
    if (mode() === "outline") {
      pen.moveTo(a[0] + 9, a[1] + PILL / 2);
      pen.lineTo(a[0] + 9, b[1]);
      pen.lineTo(b[0], b[1]);
    } else if (Math.abs(a[0] - b[0]) < 1) {
      arrowDown(a[0] + 18, a[1] + PILL / 2, b[1] - PILL / 2);
    } else {
      const from = a[0] + widthOf(parent);
      const middle = (from + b[0]) / 2;
      pen.moveTo(from, a[1]);
      pen.bezierCurveTo(middle, a[1], middle, b[1], b[0], b[1]);
    }
    pen.stroke();
  }
  pen.globalAlpha = 1;
}

/** A short arrow between the pills of a stack. */
function arrowDown(x, from, to) {
  pen.moveTo(x, from);
  pen.lineTo(x, to);
  pen.moveTo(x - 3.5, to - 3);
  pen.lineTo(x, to);
  pen.lineTo(x + 3.5, to - 3);
}

/** Chains as dashed arcs behind the pills, between the nearest frames that are shown. */
function drawChains(at) {
  const shown = (frame) => lineOf(frame).find((one) => at.has(one)) ?? 0;
  pen.setLineDash([6, 5]);
  pen.strokeStyle = look.dim;
  pen.lineWidth = 1.4;
  for (const [of, relativeTo] of tree.chains) {
    const [a, b] = [shown(of), shown(relativeTo)];
    if (a === b) continue;
    const [[ax, ay], [bx, by]] = [at.get(a), at.get(b)];
    pen.beginPath();
    if (Math.abs(ax - bx) < 60) {
      pen.moveTo(ax, ay);
      pen.quadraticCurveTo(Math.min(ax, bx) - 26 - Math.abs(by - ay) / 6, (ay + by) / 2, bx, by);
    } else {
      const [from, to] = [ax + widthOf(a) / 2, bx + widthOf(b) / 2];
      pen.moveTo(from, ay - PILL / 2);
      pen.quadraticCurveTo((from + to) / 2, Math.min(ay, by) - 34 - Math.abs(to - from) / 8, to, by - PILL / 2);
    }
    pen.stroke();
  }
  pen.setLineDash([]);
}

function drawPills(at, seen, now) {
  pen.font = FONT;
  pen.textBaseline = "middle";
  pen.direction = "ltr";
  for (const row of rows) {
    const [x, y] = at.get(row);
    if (x < seen.left || x > seen.right || y < seen.top || y > seen.bottom) continue;
    pen.globalAlpha = opacityOf(row);
    if (view.zoom > LEGIBLE) drawPill(row, x, y, now);
    else drawBar(row, x, y);
  }
  pen.globalAlpha = 1;
}

function drawPill(row, x, y, now) {
  const [width, colour, alpha] = [widthOf(row), colourOf(row), opacityOf(row)];
  const sick = row >= 0 && tree.health?.[row];
  const began = flashes.get(row);
  pen.beginPath();
  pen.roundRect(x, y - PILL / 2, width, PILL, 6);
  pen.fillStyle = hits.has(row) ? look.hit : look.card;
  pen.fill();
  pen.fillStyle = colour;
  pen.globalAlpha = alpha * 0.15;
  pen.fill();
  if (began !== undefined) {
    const left = 1 - (now - began) / FLASH;
    if (left <= 0) flashes.delete(row);
    pen.globalAlpha = Math.max(0, left);
    pen.fillStyle = look.hit;
    pen.fill();
  }
  pen.globalAlpha = alpha;
  pen.lineWidth = row === chosen || row === observer ? 3 : sick || row === hovered ? 2.4 : 1.4;
  pen.strokeStyle = row === chosen ? look.chosen : row === observer ? look.observer : sick ? look.wrong : colour;
  pen.setLineDash(row < 0 ? [3, 3] : []);
  pen.stroke();
  pen.setLineDash([]);
  pen.fillStyle = row < 0 ? look.dim : look.text;
  pen.fillText(pillText(row), x + 9, y + 0.5);
  if (row < 0 || !children[row].length) return;
  pen.fillStyle = look.dim;
  if (!open.has(row)) pen.fillText(`+${below[row]}`, x + width + 8, y + 0.5);
  else if (row === hovered) pen.fillText("\u2212", x + width + 8, y + 0.5);
}

/** A pill seen from far away. */
function drawBar(row, x, y) {
  const marked = hits.has(row) || row === chosen || row === observer;
  const sick = row >= 0 && tree.health?.[row];
  const colour = sick ? look.wrong : colourOf(row);
  pen.fillStyle = row === chosen ? look.chosen : row === observer ? look.observer : hits.has(row) ? look.hit : colour;
  const thick = Math.max(9, 2.2 / view.zoom);
  pen.fillRect(x, y - thick / 2, widthOf(row), thick);
  if (marked) pen.fillRect(x - 2 / view.zoom, y - 5 / view.zoom, 10 / view.zoom, 10 / view.zoom);
}

/** Show everything that is open. By itself the page goes no further out than text can be read; by hand it may. */
function fit(byHand) {
  const [left, top, right, bottom] = extent();
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const zoom = Math.max(0.02, Math.min(1.5, (width - 40) / (right - left), (height - 40) / (bottom - top)));
  if (!byHand && zoom < 0.8) {
    view.zoom = 0.8;
    view.x = 20 - left * 0.8;
    view.y = (bottom - top) * 0.8 < height - 40 ? (height - (top + bottom) * 0.8) / 2 : height / 2 - places.get(0)[1] * 0.8;
    if (mode() === "outline") view.y = 20 - top * 0.8;
  } else {
    view.zoom = zoom;
    view.x = Math.max(20, (width - (right - left) * zoom) / 2) - left * zoom;
    view.y = (height - (top + bottom) * zoom) / 2;
  }
  draw();
}

/** Pan as little as needed to have a row well inside the picture, where it can be read. */
function showRow(row) {
  const [x, y] = places.get(row);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (view.zoom < 0.7) {
    view.zoom = 0.9;
    view.x = width / 2 - x * view.zoom;
    view.y = height / 2 - y * view.zoom;
  }
  const [left, right] = [x * view.zoom + view.x, (x + widthOf(row)) * view.zoom + view.x];
  if (right > width - 60 || left < 20) view.x += Math.max(20, width / 2 - (right - left) / 2) - left;
  const middle = y * view.zoom + view.y;
  if (middle > height - 50 || middle < 40) view.y += height / 2 - middle;
  draw();
}

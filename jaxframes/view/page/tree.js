/* The tree as the page holds it: what hangs on what, which subtrees are open, and which rows that makes. */

const MANY = 30; // more siblings than this are cut down to the first FEW and a row that counts the rest
const FEW = 20;

let tree = null; // as the server or the file gives it
let numbers = null; // Float64Array, 19 numbers a frame, or null while they are on their way
let children = [];
let below = []; // how many frames hang below each
let open = new Set();
let few = new Map(); // how many children of a frame with many are shown
let wanted = new Map(); // children beyond these that a search or a path has asked for

/* A row is a frame, or, as a number below -1, the "n more" row of a frame; -1 is none. */
const moreOf = (frame) => -frame - 2;
const parentOf = (row) => (row < 0 ? -row - 2 : tree.parents[row]);

/** A frame, its parent, and so on to the root. */
function lineOf(frame) {
  const line = [];
  for (; frame >= 0; frame = tree.parents[frame]) line.push(frame);
  return line;
}

/** Both motions of a pair's frames relative to their common ancestor, and the frames between them. */
function route(of, relativeTo) {
  const down = lineOf(of);
  const up = lineOf(relativeTo);
  let meet = -1;
  while (down.length && up.length && down.at(-1) === up.at(-1)) {
    meet = down.pop();
    up.pop();
  }
  return { up, down: down.reverse(), meet, path: [...up, meet, ...down] };
}

/** The motion of one frame as another sees it: what `tree.motion` answers. */
function pair(of, relativeTo) {
  const { up, down } = route(of, relativeTo);
  const along = (frames) => frames.reduce((motion, frame) => composed(motion, ownMotion(numbers, frame)), AT_REST);
  return asSeen(along(up.reverse()), along(down));
}

/** Rows below a frame that is open. */
function rowsBelow(row) {
  if (row < 0 || !open.has(row)) return [];
  const all = children[row];
  if (all.length <= MANY) return all;
  const count = few.get(row) ?? FEW;
  if (count >= all.length) return all;
  const asked = wanted.get(row);
  const shown = all.filter((child, i) => i < count || asked?.has(child));
  return shown.length < all.length ? [...shown, moreOf(row)] : all;
}

/** How many children of a frame its "n more" row stands for. */
const hiddenBelow = (frame) => children[frame].length - rowsBelow(frame).length + 1;

/** All rows from the top to the bottom. */
function allRows() {
  const rows = [];
  const ahead = [0];
  while (ahead.length) {
    const row = ahead.pop();
    rows.push(row);
    const under = rowsBelow(row);
    for (let i = under.length - 1; i >= 0; i--) ahead.push(under[i]);
  }
  return rows;
}

/** How many rows of pills the open part takes; a run of only children takes one, or where it becomes a stack one each. */
function heightInRows(stacked) {
  const height = new Map();
  for (const row of allRows().reverse()) {
    const under = rowsBelow(row);
    const sum = under.reduce((total, one) => total + height.get(one), 0);
    height.set(row, Math.max(1, sum) + (stacked && under.length === 1 ? 1 : 0));
  }
  return height.get(0);
}

/** Open breadth-first, small subtrees first, as long as everything stays readable in so many rows. */
function openAtFirst(most, stacked) {
  open = new Set();
  few = new Map();
  wanted = new Map();
  const ahead = [0];
  while (ahead.length) {
    const frame = ahead.shift();
    if (!children[frame].length) continue;
    open.add(frame);
    if (frame && heightInRows(stacked) > most) {
      open.delete(frame);
      continue;
    }
    const under = rowsBelow(frame).filter((row) => row >= 0);
    ahead.push(...under.sort((a, b) => below[a] - below[b]));
  }
}

/** Open a frame and what hangs on it, nearest first, up to a number of frames. */
function openSome(frame, budget) {
  const ahead = [frame];
  let count = 0;
  while (ahead.length && (count < budget || ahead[0] === frame)) {
    const at = ahead.shift();
    if (!children[at].length) continue;
    open.add(at);
    const under = rowsBelow(at).filter((row) => row >= 0);
    count += under.length;
    ahead.push(...under);
  }
}

/** Open the way from the root to a frame; whether anything changed. */
function openTheWay(frame) {
  let changed = false;
  const line = lineOf(frame);
  for (let i = 1; i < line.length; i++) {
    if (!open.has(line[i])) {
      open.add(line[i]);
      changed = true;
    }
    if (!rowsBelow(line[i]).includes(line[i - 1])) {
      if (!wanted.has(line[i])) wanted.set(line[i], new Set());
      wanted.get(line[i]).add(line[i - 1]);
      changed = true;
    }
  }
  return changed;
}

/** Take a new tree; what was open stays open, by name. Returns the new number of an old frame, -1 for one that is gone. */
function takeTree(next) {
  const old = tree;
  const place = new Map(next.names.map((name, i) => [name, i]));
  const moved = (frame) => (frame < 0 ? -1 : (place.get(old.names[frame]) ?? -1));
  tree = next;
  const count = tree.names.length;
  children = Array.from({ length: count }, () => []);
  tree.parents.forEach((parent, i) => parent >= 0 && children[parent].push(i));
  below = new Array(count).fill(0);
  const order = [0];
  for (let i = 0; i < order.length; i++) order.push(...children[order[i]]);
  for (const frame of order.reverse()) if (frame) below[tree.parents[frame]] += below[frame] + 1;
  if (old) {
    const kept = (frames) => Array.from(frames, moved).filter((frame) => frame >= 0);
    open = new Set(kept(open));
    few = new Map([...few].map(([frame, n]) => [moved(frame), n]));
    wanted = new Map([...wanted].map(([frame, asked]) => [moved(frame), new Set(kept(asked))]));
  }
  return moved;
}

/* Data: from the file itself, or live from the server; time; and what tests and scripts may ask. */

let socket = null;
let series = null; // motions over time that a file brings
let labels = []; // a text for each instant
let playing = 0;
let asked = null; // the instant that the server was asked for and has not answered
let wish = null; // the newest instant that the reader wants

const counted = (what) => (counts[what] = 1 + Number(counts[what] ?? 0));

/** Show a tree: the first one, or what it has become. */
function showTree(next) {
  const old = tree;
  const moved = takeTree(next);
  document.title = tree.title;
  byId("title").textContent = tree.title;
  if (!old) {
    byId("coloring").value = tree.coloring;
    const most = Math.max(12, Math.floor(canvas.clientHeight / 25));
    openAtFirst(most, false);
    layout();
    if (folded) {
      openAtFirst(most, true);
      layout();
    }
    fit();
  } else {
    carryOver(old, moved);
  }
  byId("count").textContent = countText();
  fillButtons();
  if (tree.times) showTimes(tree.times);
  fillLegend();
  fillPanel();
  counted("trees");
}

/** Keep the selection, glide and flash what hangs elsewhere now, and open its new line. */
function carryOver(old, moved) {
  const places_ = new Map();
  for (const [row, place] of places) if (row >= 0 && moved(row) >= 0) places_.set(moved(row), place);
  const strayed = [];
  old.names.forEach((_, frame) => {
    const now = moved(frame);
    if (now > 0 && frame > 0 && tree.parents[now] !== moved(old.parents[frame])) strayed.push(now);
  });
  const renumbered = old.names.length !== tree.names.length || old.names.some((_, i) => moved(i) !== i);
  places = places_;
  if (renumbered || strayed.length) numbers = null;
  [chosen, observer, hovered] = [moved(chosen), chosen < 0 ? -1 : moved(observer), -1];
  if (strayed.length <= 5) strayed.forEach(openTheWay);
  layout(nearest(strayed));
  const shown = (frame) => lineOf(frame).find((one) => places.has(one));
  for (const frame of strayed) flashes.set(shown(frame), performance.now());
  if (byId("search").value.trim()) {
    hits = new Set([...hits].map(moved));
    found = found.map(moved).filter((frame) => frame >= 0);
  }
  choose(chosen, observer);
}

function showNumbers(next) {
  numbers = next;
  fillPanel();
  counted("motions");
}

/** Numbers of some frames: a row of 20 each, the frame's number first. */
function changeNumbers(part) {
  const next = new Float64Array(numbers);
  for (let i = 0; i + 20 <= part.length; i += 20) next.set(part.subarray(i + 1, i + 20), 19 * part[i]);
  showNumbers(next);
}

function fillButtons() {
  byId("buttons").replaceChildren(
    ...tree.buttons.map((label, i) => {
      const made = button(label, () => socket?.readyState === 1 && socket.send(JSON.stringify({ button: i })));
      made.disabled = socket?.readyState !== 1;
      return made;
    }),
  );
}

function say(sentence) {
  const said = byId("said");
  said.hidden = !sentence;
  if (sentence) said.replaceChildren(element("span", sentence), button("\u00d7", () => say(""), "Close"));
}

/* ---- time ---- */

function showTimes(times) {
  labels = times.labels;
  const slider = byId("slider");
  slider.max = String(labels.length - 1);
  byId("time").hidden = labels.length < 2;
  if (document.activeElement !== slider && !playing) slider.value = String(times.at);
  byId("when").textContent = printable(labels[times.at] ?? "");
}

/** Go to an instant: at once in a file; a server is asked, at most ten times a second, for the newest wish only. */
function goTo(index) {
  byId("when").textContent = printable(labels[index]);
  if (series) {
    series.show(index);
    return;
  }
  wish = index;
  if (asked === null) ask();
}

function ask() {
  if (wish === null || socket?.readyState !== 1) return;
  asked = wish;
  wish = null;
  socket.send(JSON.stringify({ time: asked }));
}

/** The server has shown the instant that it was asked for. */
function answered() {
  asked = null;
  setTimeout(() => asked === null && ask(), 100);
}

byId("slider").oninput = (event) => goTo(Number(event.target.value));
byId("play").onclick = () => {
  if (playing) return stopPlaying();
  byId("play").textContent = "Pause";
  const slider = byId("slider");
  if (slider.value === slider.max) slider.value = "0";
  playing = setInterval(() => {
    if (asked !== null) return;
    slider.value = String(Number(slider.value) + 1);
    goTo(Number(slider.value));
    if (slider.value === slider.max) stopPlaying();
  }, 100);
};
function stopPlaying() {
  clearInterval(playing);
  playing = 0;
  byId("play").textContent = "Play";
}

/* ---- where data come from ---- */

function decoded(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float64Array(bytes.buffer);
}

/** The motions over time of a file: those frames that move, and what attachable frames hang on. */
function seriesOf(given) {
  const values = decoded(given.values);
  const count = given.rows.length;
  const show = (index) => {
    given.rows.forEach((frame, i) => {
      const from = 19 * (index * count + i);
      numbers.set(values.subarray(from, from + 19), 19 * frame);
    });
    const parents = tree.parents.slice();
    given.attachable.forEach((frame, i) => (parents[frame] = given.parents[index][i]));
    const kept = numbers;
    const changed = parents.some((parent, i) => parent !== tree.parents[i]);
    if (changed) showTree({ ...tree, parents, times: null });
    showNumbers(kept);
  };
  return { show };
}

function openFile(given) {
  showTree(given.tree);
  byId("live").hidden = true;
  if (given.numbers) showNumbers(decoded(given.numbers));
  if (given.series) series = seriesOf(given.series);
}

function receive(event) {
  if (typeof event.data !== "string") {
    const data = new Float64Array(event.data);
    if (data[0] < 0) showNumbers(data.slice(1));
    else if (numbers) changeNumbers(data);
    return;
  }
  const message = JSON.parse(event.data);
  if (message.tree) showTree(message.tree);
  if (message.times) showTimes(message.times);
  if (message.health) {
    tree.health = message.health;
    tree.notes = message.notes;
    fillLegend();
    fillPanel();
    draw();
    counted("healths");
  }
  if (message.said) say(message.said);
  if (message.answered) answered();
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = receive;
  const live = byId("live");
  const turn = (on) => {
    live.className = on ? "on" : "";
    live.title = on ? "Live" : "Not connected; trying again";
    for (const one of byId("buttons").children) one.disabled = !on;
  };
  socket.onopen = () => turn(true);
  socket.onclose = () => {
    turn(false);
    asked = null;
    setTimeout(connect, 1500);
  };
  turn(false);
}

window.frames = {
  /** Where the left end of a frame's pill is in the window, or null while it is folded away. */
  at(name) {
    const place = places.get(tree.names.indexOf(name));
    if (!place) return null;
    const corner = canvas.getBoundingClientRect();
    return [corner.left + place[0] * view.zoom + view.x + 6 * view.zoom, corner.top + place[1] * view.zoom + view.y];
  },
  /** The 19 numbers of the motion of one frame as another sees it. */
  pair(of, relativeTo) {
    const motion = pair(tree.names.indexOf(of), tree.names.indexOf(relativeTo));
    return [...motion.q, ...motion.l, ...motion.w, ...motion.v, ...motion.b, ...motion.a];
  },
  /** What is shown: rows, the view, the selection. */
  shown: () => ({
    ...{ rows: rows.map((row) => (row < 0 ? pillText(row) : tree.names[row])), view: { ...view } },
    ...{ chosen: tree.names[chosen] ?? null, observer: tree.names[observer] ?? null, hits: [...hits].map((i) => tree.names[i]) },
    ...{ widths: rows.map(widthOf), parents: tree.parents, numbers: numbers !== null },
  }),
};

readLook();
const given = JSON.parse(byId("data").textContent);
if (given) openFile(given);
else connect();

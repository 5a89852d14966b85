/* The panel, the tip and the legend. */

/** An element with a text; never markup. */
function element(tag, text, style) {
  const made = document.createElement(tag);
  if (text !== undefined && text !== null) made.textContent = text;
  if (style) made.className = style;
  return made;
}

function button(text, action, title) {
  const made = element("button", text);
  made.onclick = action;
  if (title) made.title = title;
  return made;
}

/** A number in so many digits; a dash for what is not known. */
function digits(x, count) {
  if (!Number.isFinite(x)) return Number.isNaN(x) ? "\u2014" : String(x);
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e10 || size < 1e-4) return x.toExponential(count - 1).replace(/\.?0+e/, "e");
  return String(Number(x.toPrecision(count)));
}

/** Rounding noise beside larger numbers as zero. */
function withoutNoise(values) {
  const largest = Math.max(...values.map(Math.abs));
  return values.map((x) => (Math.abs(x) < 2e-15 * largest ? 0 : x));
}

function distanceText(metres, count) {
  const unit = metres >= 1.496e10 ? ` = ${digits(metres / 149597870700, 9)} au` : metres >= 1e4 ? ` = ${digits(metres / 1e3, 9)} km` : "";
  return digits(metres, count) + unit;
}

/** A motion as a grid of numbers with their units. */
function grid(motion, count) {
  const made = element("div", null, "numbers");
  const line = (name, values) => {
    made.append(element("b", name));
    const shown = withoutNoise(values);
    for (let i = 0; i < 4; i++) made.append(element("span", i < shown.length ? digits(shown[i], count) : ""));
  };
  line("position m", motion.l);
  made.append(element("b", "distance m"), element("span", distanceText(Math.hypot(...motion.l), count), "wide"));
  line("wxyz", motion.q);
  line("rpy \u00b0", rollPitchYaw(motion.q));
  line("velocity m/s", motion.v);
  line("ang. rad/s", motion.w);
  line("accel. m/s\u00b2", motion.a);
  line("ang. rad/s\u00b2", motion.b);
  return made;
}

/** A text as a literal that Python reads, with nothing in it that hides or turns text round. */
function pythonText(text) {
  const escaped = (c) => "\\u" + c.charCodeAt(0).toString(16).padStart(4, "0");
  return JSON.stringify(text).replace(UNSEEN, escaped);
}

const pythonLine = (of, relativeTo) =>
  `tree.motion(state, of=${pythonText(tree.names[of])}, relative_to=${pythonText(tree.names[relativeTo])})`;

/** A button that copies; where a page may not, it selects the text for the reader to copy. */
function copier(label, text, source) {
  const made = button(label, async () => {
    try {
      await navigator.clipboard.writeText(text());
      made.textContent = "Copied";
    } catch {
      source.textContent = text();
      getSelection().selectAllChildren(source);
      made.textContent = "Selected: press Ctrl+C";
    }
  });
  return made;
}

function crumbs(frames, between = "\u203a") {
  const made = element("div", null, "path");
  frames.forEach((frame, i) => {
    if (i && between) made.append(element("span", between, "hint"));
    const label = cut(printable(tree.labels[frame]), 32);
    made.append(button(label, () => select(frame), tree.names[frame]));
  });
  return made;
}

function fillPanel() {
  const panel = byId("panel");
  const scrolled = panel.scrollTop;
  panel.replaceChildren();
  for (const note of tree.notes) panel.append(element("p", note, "wrong"));
  if (chosen < 0) fillWithHelp(panel);
  else if (observer < 0) fillWithFrame(panel);
  else fillWithPair(panel);
  panel.scrollTop = scrolled;
}

function fillWithHelp(panel) {
  panel.append(element("h2", "Nothing selected"));
  const lines = [
    "Click a frame: its path to the root. Click a second one: the motion of the first as the second sees it.",
    "+n opens a subtree, a double click shows nothing else. Drag pans, the wheel zooms, / searches (~ for a regular expression).",
    "Arrows move, Enter opens, Space lets arrows choose an observer, Esc clears.",
  ];
  for (const line of lines) panel.append(element("p", line, "hint"));
  const sick = Object.keys(tree.health ?? {}).map(Number);
  if (!sick.length) return;
  panel.append(element("h3", `${sick.length} ${sick.length === 1 ? "frame has" : "frames have"} something wrong`));
  panel.append(crumbs(sick.slice(0, 50), ""));
}

/** One block of numbers under a title. */
function block(panel, title, of, relativeTo) {
  panel.append(element("h3", title));
  if (!numbers) {
    panel.append(element("div", "numbers are on their way", "hint"));
    return;
  }
  const motion = pair(of, relativeTo);
  panel.append(grid(motion, 9));
  const { q: wxyz, l: position, v: velocity, w: angular_velocity, a: acceleration, b: angular_acceleration } = motion;
  const all = () => JSON.stringify({ wxyz, position, velocity, angular_velocity, acceleration, angular_acceleration });
  const text = element("code", pythonLine(of, relativeTo));
  const code = element("div", null, "code");
  const exact = element("code", "");
  exact.hidden = true;
  const showing = copier("Copy numbers", all, exact);
  showing.addEventListener("click", () => (exact.hidden = !exact.textContent));
  code.append(text, copier("Copy", () => pythonLine(of, relativeTo), text));
  const side = element("div", null, "side");
  side.append(showing);
  panel.append(code, side, exact);
}

function fillWithFrame(panel) {
  const line = lineOf(chosen);
  panel.append(element("h2", tree.names[chosen]));
  const facts = [`#${chosen}`, tree.edges[chosen], `depth ${line.length - 1}`, `${below[chosen]} below`];
  panel.append(element("div", facts.join(" \u00b7 "), "hint"));
  for (const sentence of tree.health?.[chosen] ?? []) panel.append(element("p", sentence, "wrong"));
  panel.append(element("h3", "Path to the root"), crumbs(line));
  if (chosen === 0) return;
  const parent = tree.parents[chosen];
  block(panel, `Relative to its parent ${printable(tree.labels[parent])}`, chosen, parent);
  if (parent !== 0) block(panel, `Relative to the root ${printable(tree.labels[0])}`, chosen, 0);
}

function fillWithPair(panel) {
  panel.append(element("h2", tree.names[chosen]), element("h3", "as seen from"), element("h2", tree.names[observer]));
  const side = element("div", null, "side");
  side.append(button("\u21c4 Swap", () => choose(observer, chosen)), button("Clear", () => choose(-1, -1)));
  panel.append(side);
  block(panel, "Motion of the pair", chosen, observer);
  panel.append(element("h3", "Path"), crumbs(route(chosen, observer).path));
  block(panel, `The other way: ${printable(tree.labels[observer])} as seen from ${printable(tree.labels[chosen])}`, observer, chosen);
}

function showTip(row, x, y) {
  const tip = byId("tip");
  tip.hidden = row < 0;
  if (row < 0) return;
  tip.replaceChildren(element("b", tree.names[row]));
  if (tree.labels[row] !== tree.names[row]) tip.append(element("div", tree.labels[row]));
  tip.append(element("div", row ? `${tree.edges[row]} on ${tree.names[tree.parents[row]]}` : "root", "hint"));
  for (const sentence of tree.health?.[row] ?? []) tip.append(element("div", sentence, "wrong"));
  if (row && numbers) tip.append(grid(ownMotion(numbers, row), 6));
  const stage = byId("stage");
  tip.style.left = Math.max(4, Math.min(x + 14, stage.clientWidth - tip.offsetWidth - 8)) + "px";
  tip.style.top = Math.max(4, Math.min(y + 16, stage.clientHeight - tip.offsetHeight - 8)) + "px";
}

function fillLegend() {
  const legend = byId("legend");
  legend.replaceChildren();
  const entry = (tag, colour, text, style) => {
    const made = element(tag);
    const mark = element("i", null, style);
    if (colour) {
      mark.style.borderColor = colour;
      mark.style.background = colour.startsWith("#") ? colour + "29" : colour;
    }
    made.append(mark, element("span", text));
    legend.append(made);
    return made;
  };
  if (byId("coloring").value === "valency") {
    for (let n = 1; n <= 6; n++) entry("span", valencyColour(n), n === 1 ? "1 edge" : n < 6 ? `${n} edges` : "6 edges or more");
  } else {
    tree.kindNames.forEach((name, kind) => {
      const count = tree.kinds.filter((one) => one === kind).length;
      const made = entry("button", kindColour(kind), `${name} ${count}`);
      made.classList.toggle("off", faded.has(kind));
      made.title = "Fade this kind, or show it again";
      made.onclick = () => {
        if (!faded.delete(kind)) faded.add(kind);
        made.classList.toggle("off", faded.has(kind));
        draw();
      };
    });
  }
  if (tree.chains.length) entry("span", "", tree.chains.length === 1 ? "chain" : `chains ${tree.chains.length}`, "chain");
  const sick = Object.keys(tree.health ?? {}).length;
  if (sick) entry("span", look.wrong, `${sick} with something wrong`);
}

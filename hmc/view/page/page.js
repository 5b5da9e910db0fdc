"use strict";
// The page: what is shown of it, the mouse, fingers and keys, and time.
const by = (id) => document.getElementById(id);
let at = 0, playing = false, kind = null, stale = true, lastMoment = null, lastTick = 0, part = 0;

function plural(n, one, many) {
  return `${n} ${n === 1 ? one : many}`;
}
function go(to) {
  at = Math.max(0, Math.min(COUNT - 1, to));
  stale = true;
}
function button(text, pressed, act) {
  const made = document.createElement("button");
  made.textContent = text;
  if (pressed !== null) made.setAttribute("aria-pressed", pressed);
  made.addEventListener("click", () => { act(made); stale = true; });
  return made;
}
function toggle(text, get, set) {
  return button(text, get(), (made) => { set(!get()); made.setAttribute("aria-pressed", get()); });
}

function showImages() {
  const moment = MOMENTS.length ? nearestMoment(at) : null;
  if (moment === lastMoment || !moment) return;
  lastMoment = moment;
  const frame = frameOf(moment.at);
  by("moment").textContent = `Images of frame ${frame} (${(frame / DATA.fps).toFixed(2)} s), the nearest of ${plural(MOMENTS.length, "moment", "moments")}; the lines are the result`;
  DATA.cameras.forEach((camera, k) => {
    let figure = by("images").children[k];
    if (!figure) {
      figure = document.createElement("figure");
      figure.append(document.createElement("img"), document.createElement("figcaption"));
      figure.addEventListener("click", () => {
        by("large").querySelector("img").src = figure.querySelector("img").src;
        by("large").querySelector("p").textContent = figure.dataset.words;
        by("large").hidden = false;
      });
      by("images").append(figure);
    }
    const image = figure.querySelector("img"), uri = moment.images[k];
    figure.querySelector("figcaption").textContent = uri ? camera.name : `${camera.name}: no image`;
    figure.dataset.words = `${camera.name}, frame ${frame}`;
    image.alt = figure.dataset.words;
    image.style.aspectRatio = `${camera.size[0]} / ${camera.size[1]}`;
    if (uri) image.src = uri; else image.removeAttribute("src");
  });
}
function draw(now) {
  if (playing) {
    part += (now - lastTick) / 1000 * DATA.fps / DATA.stride * Number(by("speed").value);
    const whole = Math.floor(part);
    if (whole > 0) { part -= whole; go(at + whole >= COUNT ? 0 : at + whole); }
  }
  lastTick = now;
  if (stale) {
    stale = false;
    drawScene(by("scene"), at);
    drawLine(by("line"), at);
    showImages();
    by("curve-note").textContent = noteOf(kind, at) || "–";  // before the curve, whose height depends on it
    drawCurve(by("curve"), kind, at);
    const frame = frameOf(at);
    by("now").textContent = `frame ${frame}, ${(frame / DATA.fps).toFixed(2)} s`;
    by("line").setAttribute("aria-valuenow", frame);
  }
  requestAnimationFrame(draw);
}
function play(on) {
  playing = on; part = 0;
  by("play").innerHTML = on ? "&#10074;&#10074;" : "&#9654;";
  by("play").setAttribute("aria-label", on ? "Pause" : "Play");
}
function nextDoubt() {
  for (let step = 1; step <= COUNT; step++) {
    const k = (at + step) % COUNT, before = (k + COUNT - 1) % COUNT;
    const bad = (place) => DOUBTS.some((row) => row[place] > 0);
    if (bad(k) && (!bad(before) || k === 0)) return go(k);
  }
}

// Mouse and fingers turn, move and bring nearer.
function listenToScene(canvas) {
  const down = new Map();
  let apart = 0;
  const spread = () => { const [a, b] = [...down.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  const move = (dx, dy) => {
    const box = canvas.getBoundingClientRect(), view = lens(box.width, box.height), m = EYE.distance / view.focal;
    EYE.follow = false;
    [...by("views").children].forEach((one) => one.textContent === "follow" && one.setAttribute("aria-pressed", false));
    for (const k of [0, 1, 2]) EYE.target[k] += m * (-dx * view.right[k] + dy * view.up[k]);
  };
  const nearer = (factor) => { EYE.distance = Math.max(0.6, Math.min(60, EYE.distance * factor)); stale = true; };
  canvas.addEventListener("pointerdown", (e) => {
    canvas.setPointerCapture(e.pointerId);
    down.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (down.size === 2) apart = spread();
  });
  canvas.addEventListener("pointermove", (e) => {
    const before = down.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before.x, dy = e.clientY - before.y;
    down.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (down.size === 2) {
      const now = spread();
      nearer(apart / Math.max(now, 1));
      apart = now;
      move(dx / 2, dy / 2);
    } else if (e.shiftKey || e.buttons & 6) {
      move(dx, dy);
    } else {
      EYE.azimuth -= 0.4 * dx;
      EYE.elevation = Math.max(-5, Math.min(89, EYE.elevation + 0.4 * dy));
    }
    stale = true;
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => down.delete(e.pointerId));
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); nearer(Math.exp(e.deltaY * 0.0012)); }, { passive: false });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("dblclick", () => { resetEye(false); stale = true; });
}
function listenToTime(canvas, left, right) {
  const seek = (e) => { const box = canvas.getBoundingClientRect(); go(atPlace(e.clientX - box.left, box.width, left, right)); };
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); play(false); seek(e); });
  canvas.addEventListener("pointermove", (e) => { if (e.buttons) seek(e); });
}
function listenToKeys() {
  document.addEventListener("keydown", (e) => {
    if (e.key === "Escape") by("large").hidden = true;
    if (["SELECT", "INPUT"].includes(document.activeElement.tagName)) return;
    const act = { ArrowRight: () => go(at + 1), ArrowLeft: () => go(at - 1), Home: () => go(0), End: () => go(COUNT - 1), " ": () => play(!playing) }[e.key];
    if (!act || (e.key === " " && document.activeElement.tagName === "BUTTON")) return;
    e.preventDefault();
    act();
  });
}

function begin() {
  const last = frameOf(COUNT - 1), skipped = DATA.stride > 1 ? `, every ${DATA.stride}th shown` : "";
  by("name").textContent = DATA.name;
  by("facts").textContent = `${plural(PEOPLE.length, "person", "people")}, ${plural(last - DATA.first + 1, "frame", "frames")} (${DATA.first} to ${last}${skipped}), ${plural(DATA.cameras.length, "camera", "cameras")}, ${+DATA.fps.toFixed(2)} frames a second`;
  Object.assign(document.body.dataset, { people: PEOPLE.length, frames: COUNT, cameras: DATA.cameras.length, moments: MOMENTS.length });
  const there = { bodies: PEOPLE.some((p) => p.rings), bones: PEOPLE.some((p) => p.landmarks), voxels: MOMENTS.some((m) => m.voxels), ways: true, cameras: true };
  for (const name of Object.keys(LAYERS)) {
    if (!there[name]) LAYERS[name] = false;
    else by("layers").append(toggle(name, () => LAYERS[name], (on) => { LAYERS[name] = on; }));
  }
  by("views").append(
    button("people", null, () => { EYE.follow = false; resetEye(false); }), button("all", null, () => { resetEye(true); }),
    button("top", null, () => { EYE.elevation = 89; EYE.azimuth = -90; }), toggle("follow", () => EYE.follow, (on) => { EYE.follow = on; }));
  for (const person of PEOPLE) {
    const made = toggle(`person ${person.number}`, () => person.shown, (on) => { person.shown = on; });
    made.style.setProperty("--own", person.color);
    by("people").append(made);
  }
  const kinds = curveKinds(), groups = new Map();
  kinds.forEach((one, k) => {
    if (!groups.has(one.group)) {
      const made = document.createElement("optgroup");
      made.label = one.group;
      groups.set(one.group, made);
      by("kind").append(made);
    }
    const option = document.createElement("option");
    option.value = k;
    option.textContent = one.unit === "m" && one.landmark >= 0 ? `height of ${one.name}` : one.name;
    groups.get(one.group).append(option);
  });
  const wrist = kinds.findIndex((one) => one.name === "right ankle");
  kind = kinds[Math.max(0, wrist)];
  by("kind").value = Math.max(0, wrist);
  by("kind").addEventListener("change", () => { kind = kinds[Number(by("kind").value)]; stale = true; });
  by("play").addEventListener("click", () => play(!playing));
  by("back").addEventListener("click", () => { play(false); go(at - 1); });
  by("on").addEventListener("click", () => { play(false); go(at + 1); });
  by("doubt").addEventListener("click", () => { play(false); nextDoubt(); });
  by("doubt").disabled = !DOUBTS.some((row) => row.some((n) => n > 0));
  by("large").addEventListener("click", () => { by("large").hidden = true; });
  by("line").setAttribute("aria-valuemin", DATA.first);
  by("line").setAttribute("aria-valuemax", last);
  listenToScene(by("scene"));
  listenToTime(by("line"), EDGE, EDGE);
  listenToTime(by("curve"), SIDE, EDGE);
  listenToKeys();
  window.addEventListener("resize", () => { stale = true; });
  resetEye(false);
  const asked = Number(new URLSearchParams(location.hash.slice(1)).get("frame"));
  const wanted = location.hash ? Math.round((asked - DATA.first) / DATA.stride) : MOMENTS.length ? MOMENTS[Math.floor(MOMENTS.length / 2)].at : 0;
  go(wanted);
  requestAnimationFrame((now) => { lastTick = now; draw(now); });
}
begin();

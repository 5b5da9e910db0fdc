"use strict";
// The page's data: arrays of numbers in base64 (hmc/view/page/packed.py).
window.addEventListener("error", (e) => { document.body.dataset.fault = e.message; });
const DATA = JSON.parse(document.getElementById("data").textContent);
const MISSING = -32768, UNKNOWN = 255;
const LEFT = "#ff8c28", RIGHT = "#3ca0ff";

function unpack(packed) {
  if (!packed) return null;
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const kind = { u1: Uint8Array, u2: Uint16Array, i2: Int16Array, f4: Float32Array }[packed.type];
  const raw = new kind(bytes.buffer);
  if (packed.step === undefined) return raw;
  const out = new Float32Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw[k] === MISSING ? NaN : raw[k] * packed.step;
  return out;
}

const N_LANDMARKS = DATA.landmarks.length, N_BONES = DATA.bones.length, COUNT = DATA.count;
const PEOPLE = DATA.people.map((one) => {
  const person = { number: one.number, color: one.color, shown: true };
  for (const name of ["landmarks", "views", "trust", "way", "rings", "segments", "turns", "places", "angles", "costs"]) person[name] = unpack(one[name]);
  if (one.rings) person.ring = one.rings.shape[1] / 2;
  return person;
});
const MOMENTS = DATA.moments.map((one) => ({ at: (one.frame - DATA.first) / DATA.stride, images: one.images, voxels: unpack(one.voxels), shades: unpack(one.shades) }));

// Whether a landmark is to be doubted: by its trust where that is known, else by the number of cameras that show it clear.
function doubted(person, at, k) {
  const place = at * N_LANDMARKS + k;
  if (person.trust && person.trust[place] !== UNKNOWN) return person.trust[place] < DATA.trusted;
  return Boolean(person.views) && person.views[place] !== UNKNOWN && person.views[place] < DATA.enough;
}
function known(person, at) {
  return person.landmarks ? !isNaN(person.landmarks[at * N_LANDMARKS * 3]) : Boolean(person.way) && !isNaN(person.way[at * 3]);
}
// How many landmarks of a person are doubted in a frame: -1 where there is no pose.
const DOUBTS = PEOPLE.map((person) => {
  const out = new Int8Array(COUNT).fill(-1);
  for (let at = 0; at < COUNT; at++) {
    if (!known(person, at)) continue;
    out[at] = 0;
    for (let k = 0; person.landmarks && k < N_LANDMARKS; k++) out[at] += doubted(person, at, k) ? 1 : 0;
  }
  return out;
});
function nearestMoment(at) {
  let best = 0;
  for (let k = 1; k < MOMENTS.length; k++) if (Math.abs(MOMENTS[k].at - at) <= Math.abs(MOMENTS[best].at - at)) best = k;
  return MOMENTS[best];
}
function frameOf(at) {
  return DATA.first + at * DATA.stride;
}
// A canvas with as many pixels as the screen shows of it: its context, width and height in CSS pixels.
function sized(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2), box = canvas.getBoundingClientRect();
  const width = Math.max(1, Math.round(box.width * ratio)), height = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  return [pen, box.width, box.height];
}

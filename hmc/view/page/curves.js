"use strict";
// The time line, and curves over time.
const SIDE = 46, EDGE = 8;

function placeOf(at, width, left, right) {
  return left + (COUNT > 1 ? at / (COUNT - 1) : 0.5) * (width - left - right);
}
function atPlace(x, width, left, right) {
  return Math.max(0, Math.min(COUNT - 1, Math.round((x - left) / (width - left - right) * (COUNT - 1))));
}
function styleOf(doubts) {
  return doubts < 0 ? "--none" : doubts === 0 ? "--good" : doubts <= 3 ? "--some" : "--many";
}

// A row a person: colors tell how many of the landmarks are doubted.
function drawLine(canvas, at) {
  const [pen, width, height] = sized(canvas), colors = getComputedStyle(document.documentElement), n = PEOPLE.length;
  const rows = height - 10, high = Math.min(14, rows / n - 1);
  PEOPLE.forEach((person, row) => {
    const y = 10 + row * (rows / n);
    pen.fillStyle = person.color;
    pen.fillRect(0, y, 4, high);
    for (let from = 0; from < COUNT; ) {
      const style = styleOf(DOUBTS[row][from]);
      let to = from + 1;
      while (to < COUNT && styleOf(DOUBTS[row][to]) === style) to++;
      const x0 = placeOf(from - 0.5, width, EDGE, EDGE), x1 = placeOf(to - 0.5, width, EDGE, EDGE);
      pen.fillStyle = colors.getPropertyValue(style);
      pen.fillRect(Math.max(EDGE, x0), y, Math.min(width - EDGE, x1) - Math.max(EDGE, x0) + 0.3, high);
      from = to;
    }
  });
  pen.fillStyle = colors.getPropertyValue("--moment");
  for (const moment of MOMENTS) pen.fillRect(placeOf(moment.at, width, EDGE, EDGE) - 0.5, 2, 1.5, 6);
  const x = placeOf(at, width, EDGE, EDGE);
  pen.fillStyle = "#fff";
  pen.fillRect(x - 1, 0, 2, height);
  pen.beginPath(); pen.moveTo(x - 5, 0); pen.lineTo(x + 5, 0); pen.lineTo(x, 7); pen.fill();
}

// What may be drawn: [name, unit, values of a person at a frame, whether a landmark tells of doubt].
function curveKinds() {
  const kinds = [], any = (name) => PEOPLE.some((person) => person[name]);
  const title = (name) => name.replace(/^l_/, "left ").replace(/^r_/, "right ").replace(/_/g, " ");
  if (any("landmarks")) {
    DATA.landmarks.forEach((name, k) => kinds.push({ group: "Height above the floor", name: title(name), unit: "m", of: (p, at) => p.landmarks ? p.landmarks[3 * (at * N_LANDMARKS + k) + 2] : NaN, landmark: k }));
  } else {
    [["x", 0], ["y", 1]].forEach(([name, k]) => kinds.push({ group: "Position", name, unit: "m", of: (p, at) => p.way[3 * at + k], landmark: -1 }));
  }
  if (any("angles")) {
    const side = { l: [3, 4, 5, 9, 10, 11], r: [6, 7, 8, 12, 13, 14] };
    DATA.angles.forEach((name, k) => {
      const joint = name.replace(/_[xyz]$/, ""), end = { shoulder: 1, elbow: 2, hip: 4, knee: 5, girdle: 0 }[joint.slice(2)], list = side[joint[0]];
      const landmark = end !== undefined && /^[lr]_/.test(joint) ? list[end] : -1;
      kinds.push({ group: "Angle, degrees", name: title(name), unit: "°", of: (p, at) => p.angles ? p.angles[at * DATA.angles.length + k] : NaN, landmark });
    });
  }
  if (PEOPLE.some((person) => person.costs && person.costs.some((cost) => !isNaN(cost)))) {
    kinds.push({ group: "Fit", name: "cost", unit: "", of: (p, at) => p.costs ? p.costs[at] : NaN, landmark: -1 });
  }
  return kinds;
}
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough), out = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) out.push(k * step);
  return [out, step];
}
function told(value, step) {
  return value !== 0 && Math.abs(value) < 1e-3 ? value.toExponential(1) : value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
}
function said(value, unit) {
  return unit === "m" ? `${value.toFixed(3)} m` : unit ? value.toFixed(1) + unit : value.toPrecision(3);
}
function drawCurve(canvas, kind, at) {
  const [pen, width, height] = sized(canvas);
  let low = Infinity, high = -Infinity;
  for (const person of PEOPLE) {
    for (let k = 0; person.shown && k < COUNT; k++) {
      const value = kind.of(person, k);
      if (!isNaN(value)) { low = Math.min(low, value); high = Math.max(high, value); }
    }
  }
  if (!(low <= high)) return;
  const least = { m: 0.1, "°": 10 }[kind.unit] || 1e-9 + Math.abs(high) * 0.1, pad = Math.max(least - (high - low), 0.12 * (high - low)) / 2;
  low -= pad; high += pad;
  const top = 6, foot = 18, y = (value) => top + (high - value) / (high - low) * (height - top - foot);
  pen.font = "11px system-ui, sans-serif"; pen.textBaseline = "middle";
  const [marks, step] = ticks(low, high, Math.max(3, height / 30));
  pen.textAlign = "right";
  for (const mark of marks) {
    pen.fillStyle = "#2b323c"; pen.fillRect(SIDE, y(mark), width - SIDE - EDGE, 1);
    pen.fillStyle = "#9aa4b2"; pen.fillText(told(mark, step) + (kind.unit === "m" ? " m" : kind.unit), SIDE - 5, y(mark));
  }
  const span = (COUNT - 1) * DATA.stride / DATA.fps, begin = DATA.first / DATA.fps;
  pen.textAlign = "center";
  if (span > 0) {
    const [seconds, apart] = ticks(begin, begin + span, Math.max(2, width / 90));
    for (const second of seconds) {
      const x = SIDE + (second - begin) / span * (width - SIDE - EDGE);
      pen.fillStyle = "#9aa4b2"; pen.fillText(told(second, apart) + " s", Math.min(x, width - 14), height - 8);
    }
  }
  pen.fillStyle = "#ffffff66"; pen.fillRect(placeOf(at, width, SIDE, EDGE) - 0.5, top, 1, height - top - foot);
  pen.lineWidth = 1.6; pen.lineJoin = "round";
  PEOPLE.forEach((person) => {
    if (!person.shown) return;
    pen.strokeStyle = pen.fillStyle = person.color;
    for (const pale of [false, true]) {
      pen.globalAlpha = pale ? 0.45 : 1; pen.setLineDash(pale ? [2, 3] : []);
      pen.beginPath();
      for (let k = 0; k + 1 < COUNT; k++) {
        const a = kind.of(person, k), b = kind.of(person, k + 1);
        const doubt = kind.landmark >= 0 && person.landmarks && (doubted(person, k, kind.landmark) || doubted(person, k + 1, kind.landmark));
        if (isNaN(a) || isNaN(b) || Boolean(doubt) !== pale) continue;
        pen.moveTo(placeOf(k, width, SIDE, EDGE), y(a)); pen.lineTo(placeOf(k + 1, width, SIDE, EDGE), y(b));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1; pen.setLineDash([]);
    const value = kind.of(person, at);
    if (!isNaN(value)) { pen.beginPath(); pen.arc(placeOf(at, width, SIDE, EDGE), y(value), 3.2, 0, 7); pen.fill(); }
  });
}
// What is at a frame, in words.
function noteOf(kind, at) {
  return PEOPLE.filter((person) => person.shown && !isNaN(kind.of(person, at))).map((person) => `person ${person.number}: ${said(kind.of(person, at), kind.unit)}`).join(" · ");
}

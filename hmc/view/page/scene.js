"use strict";
// The room in 3-D, drawn far to near on a canvas: floor, cameras, voxels, ways, flesh, bones.
const LAYERS = { bodies: true, bones: true, voxels: true, ways: true, cameras: true };
const EYE = { azimuth: -55, elevation: 22, distance: 6, target: [0, 0, 0.9], follow: false };
const FOV = 40 * Math.PI / 180, NEAR = 0.1;

function bounds() {
  const low = [Infinity, Infinity, 0], high = [-Infinity, -Infinity, 1.9];
  for (const person of PEOPLE) {
    const points = person.landmarks || person.way;
    for (let k = 0; points && k < points.length; k += 3) {
      if (isNaN(points[k])) continue;
      for (const axis of [0, 1, 2]) { low[axis] = Math.min(low[axis], points[k + axis]); high[axis] = Math.max(high[axis], points[k + axis]); }
    }
  }
  return [low, high];
}
function resetEye(all) {
  const [low, high] = all ? DATA.room : bounds();
  const size = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  EYE.target = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, all ? 0.8 : (low[2] + high[2]) / 2];
  EYE.distance = Math.max(2.5, 0.52 * size / Math.tan(FOV / 2));
  EYE.azimuth = -55; EYE.elevation = 22;
}
function centreOf(at) {
  const sum = [0, 0], people = PEOPLE.filter((person) => person.shown && known(person, at));
  for (const person of people) {
    const points = person.landmarks || person.way, place = at * (person.landmarks ? N_LANDMARKS : 1) * 3;
    sum[0] += points[place]; sum[1] += points[place + 1];
  }
  return people.length ? [sum[0] / people.length, sum[1] / people.length, 0.9] : null;
}

function lens(width, height) {
  const a = EYE.azimuth * Math.PI / 180, e = EYE.elevation * Math.PI / 180;
  const away = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  const right = [-Math.sin(a), Math.cos(a), 0], up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
  const focal = Math.min(width, height * 1.2) / 2 / Math.tan(FOV / 2), eye = EYE.target.map((t, k) => t + EYE.distance * away[k]);
  // A world point to [x, y, depth]; null behind the eye.
  const project = (x, y, z) => {
    const px = x - eye[0], py = y - eye[1], pz = z - eye[2];
    const depth = -(px * away[0] + py * away[1] + pz * away[2]);
    if (depth < NEAR) return null;
    return [width / 2 + focal * (px * right[0] + py * right[1]) / depth, height / 2 - focal * (px * up[0] + py * up[1] + pz * up[2]) / depth, depth];
  };
  return { project, focal, right, up };
}

function mixed(hex, light) {
  const parts = [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
  const mix = light < 1 ? parts.map((c) => c * light) : parts.map((c) => c + (255 - c) * (light - 1));
  return `rgb(${mix.map(Math.round).join(",")})`;
}
function hullOf(points) {
  points.sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const cross = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  const half = (list) => {
    const out = [];
    for (const p of list) {
      while (out.length > 1 && cross(out[out.length - 2], out[out.length - 1], p) <= 0) out.pop();
      out.push(p);
    }
    out.pop();
    return out;
  };
  return half(points).concat(half(points.slice().reverse()));
}
function path(pen, points, closed) {
  pen.beginPath();
  points.forEach((p, k) => (k ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
  if (closed) pen.closePath();
}
function line(pen, project, points, style, width, dash) {
  pen.strokeStyle = style; pen.lineWidth = width; pen.setLineDash(dash || []);
  let open = false;
  pen.beginPath();
  for (const point of points) {
    const p = point && project(...point);
    if (p) { if (open) pen.lineTo(p[0], p[1]); else pen.moveTo(p[0], p[1]); }
    open = Boolean(p);
  }
  pen.stroke();
  pen.setLineDash([]);
}

function drawFloor(pen, view) {
  const [[x0, y0], [x1, y1]] = DATA.room;
  const corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map((p) => view.project(p[0], p[1], 0));
  if (corners.every(Boolean)) { path(pen, corners, true); pen.fillStyle = "#20262f"; pen.fill(); }
  const steps = (a, b) => [a, ...Array.from({ length: Math.max(0, Math.ceil(b) - Math.ceil(a + 1e-6)) }, (_, k) => Math.ceil(a + 1e-6) + k), b];
  const cut = (a, b, make) => Array.from({ length: 25 }, (_, k) => make(a + (b - a) * k / 24));
  for (const x of steps(x0, x1)) line(pen, view.project, cut(y0, y1, (y) => [x, y, 0]), "#3a434f", 1);
  for (const y of steps(y0, y1)) line(pen, view.project, cut(x0, x1, (x) => [x, y, 0]), "#3a434f", 1);
  [["x", [1, 0], "#c86464"], ["y", [0, 1], "#6cb46c"]].forEach(([name, d, style]) => {
    line(pen, view.project, [[0, 0, 0], [0.5 * d[0], 0.5 * d[1], 0]], style, 2);
    const p = view.project(0.6 * d[0], 0.6 * d[1], 0);
    if (p) { pen.fillStyle = style; pen.font = "11px system-ui, sans-serif"; pen.fillText(name, p[0] - 3, p[1] + 3); }
  });
}
function drawCameras(pen, view) {
  for (const camera of DATA.cameras) {
    const [a, b, c, d] = camera.corners, o = camera.centre;
    for (const chain of [[a, b, c, d, a], [a, o, b], [c, o, d]]) line(pen, view.project, chain, "#7f8b9b", 1.2);
    const p = view.project(...o);
    if (p) { pen.fillStyle = "#aab4c2"; pen.font = "11px system-ui, sans-serif"; pen.fillText(camera.name, p[0] + 7, p[1] - 6); }
  }
}
function drawWays(pen, view, at) {
  const long = Math.max(2, Math.round(2 * DATA.fps / DATA.stride));
  for (const person of PEOPLE) {
    if (!person.shown) continue;
    const points = person.way || person.landmarks, n = person.way ? 3 : 3 * N_LANDMARKS;
    const way = (from, to) => Array.from({ length: Math.max(0, to - from) }, (_, k) => {
      const place = (from + k) * n;
      return isNaN(points[place]) ? null : [points[place], points[place + 1], 0];
    });
    pen.globalAlpha = 0.28;
    line(pen, view.project, way(0, COUNT), person.color, 1);
    pen.globalAlpha = 1;
    line(pen, view.project, way(Math.max(0, at - long), at + 1), person.color, 2);
    if (known(person, at) && !person.landmarks) {
      const x = points[at * n], y = points[at * n + 1], h = points[at * n + 2];
      for (const r of [0, 1, 2]) {
        const ring = Array.from({ length: 37 }, (_, k) => [Math.cos(k * Math.PI / 18), Math.sin(k * Math.PI / 18)]);
        line(pen, view.project, ring.map(([c, s]) => (r === 0 ? [x + 0.3 * c, y + 0.3 * s, h] : r === 1 ? [x + 0.3 * c, y, h + h * s] : [x, y + 0.3 * c, h + h * s])), person.color, 1.4);
      }
    }
  }
}

// Things to be drawn far to near: depth, kind, and what the kind needs.
function voxelThings(view, moment, things) {
  const { voxels, shades } = moment, side = DATA.voxel, o = DATA.origin;
  for (let k = 0; voxels && k < shades.length; k++) {
    const p = view.project(o[0] + side * voxels[3 * k], o[1] + side * voxels[3 * k + 1], o[2] + side * voxels[3 * k + 2]);
    if (p) things.push([p[2], 0, p, shades[k], 1.2 * view.focal * side / p[2]]);
  }
}
function fleshThings(view, person, at, things) {
  const cones = person.segments.length, per = 2 * person.ring;
  for (let c = 0; c < cones; c++) {
    const segment = at * DATA.ends.length + person.segments[c];
    const [tx, ty, tz] = person.places.subarray(3 * segment, 3 * segment + 3);
    if (isNaN(tx)) continue;
    const [x, y, z, w] = person.turns.subarray(4 * segment, 4 * segment + 4);
    const points = [], middle = [0, 0, 0];
    let depth = 0, ends = [[0, 0], [0, 0]];
    for (let k = 0; k < per; k++) {
      const i = 3 * (c * per + k), px = person.rings[i], py = person.rings[i + 1], pz = person.rings[i + 2];
      const ax = 2 * (y * pz - z * py), ay = 2 * (z * px - x * pz), az = 2 * (x * py - y * px);
      const p = view.project(px + w * ax + y * az - z * ay + tx, py + w * ay + z * ax - x * az + ty, pz + w * az + x * ay - y * ax + tz);
      if (!p) break;
      points.push(p);
      depth += p[2] / per;
      const end = ends[k < person.ring ? 0 : 1];
      end[0] += p[0] / person.ring; end[1] += p[1] / person.ring;
    }
    if (points.length === per) things.push([depth, 1, hullOf(points), ends, person, doubtfulSegment(person, at, person.segments[c])]);
  }
}
// What is doubted of a limb's end is doubted of its flesh.
function doubtfulSegment(person, at, segment) {
  return doubted(person, at, DATA.ends[segment]);
}
function boneThings(view, person, at, things) {
  for (const [a, b] of DATA.bones) {
    const i = 3 * (at * N_LANDMARKS + a), j = 3 * (at * N_LANDMARKS + b), p = person.landmarks;
    if (isNaN(p[i]) || isNaN(p[j])) continue;
    const from = view.project(p[i], p[i + 1], p[i + 2]), to = view.project(p[j], p[j + 1], p[j + 2]);
    if (!from || !to) continue;
    const name = DATA.landmarks[b], color = name.startsWith("l_") ? LEFT : name.startsWith("r_") ? RIGHT : person.color;
    things.push([(from[2] + to[2]) / 2 - (LAYERS.bodies ? 0.25 : 0), 2, from, to, color, doubted(person, at, b), view.focal * 0.011 / from[2]]);
  }
}
function drawThing(pen, thing) {
  if (thing[1] === 0) {
    const [, , p, shade, side] = thing, light = shade / 255;
    pen.fillStyle = `rgb(${Math.round(188 * light)},${Math.round(200 * light)},${Math.round(214 * light)})`;
    pen.fillRect(p[0] - side / 2, p[1] - side / 2, side, side);
  } else if (thing[1] === 1) {
    const [, , hull, [a, b], person, doubt] = thing;
    const dx = b[0] - a[0], dy = b[1] - a[1], long = Math.hypot(dx, dy) || 1, n = [-dy / long, dx / long];
    if (n[0] * -0.6 + n[1] * -0.8 < 0) { n[0] = -n[0]; n[1] = -n[1]; }
    const mx = (a[0] + b[0]) / 2, my = (a[1] + b[1]) / 2;
    let wide = 1;
    for (const p of hull) wide = Math.max(wide, Math.abs((p[0] - mx) * n[0] + (p[1] - my) * n[1]));
    const shine = pen.createLinearGradient(mx + n[0] * wide, my + n[1] * wide, mx - n[0] * wide, my - n[1] * wide);
    shine.addColorStop(0, mixed(person.color, 1.25)); shine.addColorStop(0.4, mixed(person.color, 0.85)); shine.addColorStop(1, mixed(person.color, 0.42));
    pen.globalAlpha = doubt ? 0.25 : LAYERS.bones ? 0.82 : 1;
    path(pen, hull, true);
    pen.fillStyle = shine; pen.fill();
    if (doubt) { pen.globalAlpha = 0.7; pen.strokeStyle = person.color; pen.lineWidth = 1; pen.setLineDash([3, 3]); pen.stroke(); pen.setLineDash([]); }
    pen.globalAlpha = 1;
  } else {
    const [, , from, to, color, doubt, width] = thing;
    pen.lineCap = "round";
    pen.setLineDash(doubt ? [2, Math.max(6, 2.4 * width)] : []);
    for (const [style, more] of doubt ? [[color, 0]] : [["#15181d", 2], [color, 0]]) {
      path(pen, [from, to]); pen.strokeStyle = style; pen.lineWidth = Math.max(1.5, width) + more; pen.stroke();
    }
    pen.setLineDash([]); pen.lineCap = "butt";
    if (!doubt) { pen.beginPath(); pen.arc(to[0], to[1], Math.max(1.5, 0.8 * width), 0, 7); pen.fillStyle = "#fff"; pen.fill(); }
  }
}
function drawAll(pen, things) {
  things.sort((a, b) => b[0] - a[0]);
  for (const thing of things) drawThing(pen, thing);
}
function drawScene(canvas, at) {
  const [pen, width, height] = sized(canvas);
  if (EYE.follow) EYE.target = centreOf(at) || EYE.target;
  const view = lens(width, height), things = [];
  drawFloor(pen, view);
  if (LAYERS.ways) drawWays(pen, view, at);
  if (LAYERS.cameras) drawCameras(pen, view);
  const moment = MOMENTS.length ? nearestMoment(at) : null;
  if (LAYERS.voxels && moment && moment.at === at && (!playing || MOMENTS.length === COUNT)) {
    voxelThings(view, moment, things);
    drawAll(pen, things.splice(0));  // hulls are fatter than people and would hide them: bodies are drawn over them
  }
  for (const person of PEOPLE) {
    if (!person.shown || !person.landmarks || !known(person, at)) continue;
    if (LAYERS.bodies && person.rings) fleshThings(view, person, at, things);
    if (LAYERS.bones || !person.rings) boneThings(view, person, at, things);
  }
  drawAll(pen, things);
  for (const person of PEOPLE) {
    if (!person.shown || !known(person, at)) continue;
    const points = person.landmarks || person.way, i = person.landmarks ? 3 * (at * N_LANDMARKS + 2) : 3 * at;
    const p = isNaN(points[i]) ? null : view.project(points[i], points[i + 1], points[i + 2] * (person.landmarks ? 1 : 2) + 0.12);
    if (!p) continue;
    pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = "center";
    pen.strokeStyle = "#14171c"; pen.lineWidth = 3; pen.strokeText(person.number, p[0], p[1]);
    pen.fillStyle = person.color; pen.fillText(person.number, p[0], p[1]); pen.textAlign = "start";
  }
}

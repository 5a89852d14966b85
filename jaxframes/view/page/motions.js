"use strict";
/* Motions: rotation q (wxyz), position l, angular and linear velocity w and v, angular and linear acceleration b and a. */

const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const less = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const conjugate = (q) => [q[0], -q[1], -q[2], -q[3]];

/** The rotation p after the rotation r: their Hamilton product. */
function product(p, r) {
  const [pv, rv] = [p.slice(1), r.slice(1)];
  const vector = plus(plus(times(p[0], rv), times(r[0], pv)), cross(pv, rv));
  return [p[0] * r[0] - pv[0] * rv[0] - pv[1] * rv[1] - pv[2] * rv[2], ...vector];
}

/** The vector v turned by the unit quaternion q. */
function turned(q, v) {
  const u = q.slice(1);
  const t = times(2, cross(u, v));
  return plus(plus(v, times(q[0], t)), cross(u, t));
}

const AT_REST = { q: [1, 0, 0, 0], l: [0, 0, 0], w: [0, 0, 0], v: [0, 0, 0], b: [0, 0, 0], a: [0, 0, 0] };

/** The motion of a frame relative to its parent, out of the 19 numbers that the page was given for it. */
function ownMotion(numbers, frame) {
  const part = (from, to) => Array.from(numbers.subarray(19 * frame + from, 19 * frame + to));
  return { q: part(0, 4), l: part(4, 7), w: part(7, 10), v: part(10, 13), b: part(13, 16), a: part(16, 19) };
}

/** The motion o -> p of o -> m and m -> p. */
function composed(first, second) {
  const r = turned(first.q, second.l);
  const w = turned(first.q, second.w);
  const v = turned(first.q, second.v);
  const whirl = cross(first.w, r);
  return {
    q: product(first.q, second.q),
    l: plus(first.l, r),
    w: plus(first.w, w),
    v: plus(plus(first.v, whirl), v),
    b: plus(plus(first.b, turned(first.q, second.b)), cross(first.w, w)),
    a: plus(plus(first.a, turned(first.q, second.a)), plus(cross(first.b, r), cross(first.w, plus(whirl, times(2, v))))),
  };
}

/** The motion of a target as an observer sees it, both given relative to one common frame. */
function asSeen(observer, target) {
  const back = conjugate(observer.q);
  const r = less(target.l, observer.l);
  const swept = cross(observer.w, r);
  const u = less(less(target.v, observer.v), swept);
  const bend = less(less(target.a, observer.a), cross(observer.b, r));
  return {
    q: product(back, target.q),
    l: turned(back, r),
    w: turned(back, less(target.w, observer.w)),
    v: turned(back, u),
    b: turned(back, less(less(target.b, observer.b), cross(observer.w, target.w))),
    a: turned(back, less(bend, cross(observer.w, plus(swept, times(2, u))))),
  };
}

/** Roll, pitch and yaw in degrees of a rotation. */
function rollPitchYaw([w, x, y, z]) {
  const angles = [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x)))),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
  return angles.map((angle) => (angle * 180) / Math.PI);
}

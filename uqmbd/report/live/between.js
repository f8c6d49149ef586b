// Poses between the frames of a motion: cubic in time, with slopes from the frames on both sides.

/** The frames that a time lies between, and what the pose of each counts: [frame, weight], the nearest frame first. */
export function weightsAt(times, time) {
  const last = times.length - 1;
  if (last < 1 || time <= times[0]) return [[0, 1]];
  if (time >= times[last]) return [[last, 1]];
  let k = 0;
  while (times[k + 1] <= time) k++;
  const step = times[k + 1] - times[k];
  const s = (time - times[k]) / step;
  if (s === 0) return [[k, 1]];
  const weights = new Map([[k, (1 + 2 * s) * (1 - s) ** 2], [k + 1, s * s * (3 - 2 * s)]]);
  const add = (frame, weight) => weights.set(frame, (weights.get(frame) ?? 0) + weight);
  /** Add the slope at a frame: that of the parabola through it and its neighbours, at an end that of the line. */
  const slope = (frame, weight) => {
    const sides = [[frame - 1, frame], [frame, frame + 1]].filter(([low, high]) => low >= 0 && high <= last);
    const lengths = sides.map(([low, high]) => times[high] - times[low]);
    const whole = lengths.reduce((sum, length) => sum + length);
    sides.forEach(([low, high], n) => {
      const share = sides.length > 1 ? (whole - lengths[n]) / whole : 1;
      add(high, (weight * share) / lengths[n]);
      add(low, (-weight * share) / lengths[n]);
    });
  };
  slope(k, step * s * (1 - s) ** 2);
  slope(k + 1, step * s * s * (s - 1));
  return [...weights].sort((a, b) => b[1] - a[1]);
}

/**
 * A pose from those of frames.
 *
 * @param read - returns the pose of a frame: a position of `dimension` numbers, and a unit quaternion or half-angle pair
 * @param weights - as of `weightsAt`; where one of the frames is not known the nearest one stands alone
 */
export function poseAt(read, weights, dimension) {
  const nearest = read(weights[0][0]);
  if (weights.length === 1) return nearest;
  const pose = nearest.map(() => 0);
  for (const [frame, weight] of weights) {
    const own = read(frame);
    // a quaternion and its negative are the same turn
    const sign = own.reduce((sum, x, c) => sum + (c < dimension ? 0 : x * nearest[c]), 0) < 0 ? -1 : 1;
    own.forEach((x, c) => (pose[c] += weight * (c < dimension ? x : sign * x)));
  }
  if (!pose.every(Number.isFinite)) return nearest;
  const size = Math.hypot(...pose.slice(dimension)) || 1;
  return pose.map((x, c) => (c < dimension ? x : x / size));
}

const FAILING = 0.2;
const MOVED = 0.1;
const TURNED = 0.15;

/**
 * Whether frames are near enough to one another for poses between them: whether most of them are what their neighbours
 * tell.  A mechanism that turns several times between two frames is anywhere between them.
 *
 * @param read - as of `poseAt`, of one body
 * @param size - of the whole mechanism, m: a place that is a tenth of it away is another one
 */
export function resolvedBy(times, read, dimension, size) {
  const inner = Array.from(times.keys()).slice(1, -1);
  const wrong = inner.filter((k) => {
    const others = Array.from(times.keys()).filter((n) => n !== k);
    const near = others.slice(Math.max(k - 3, 0), k + 3);
    const weights = weightsAt(near.map((n) => times[n]), times[k]).map(([n, weight]) => [near[n], weight]);
    const [own, told] = [read(k), poseAt(read, weights, dimension)];
    const moved = Math.hypot(...own.slice(0, dimension).map((x, c) => x - told[c]));
    // half the angle between two turns
    const along = Math.abs(own.slice(dimension).reduce((sum, x, c) => sum + x * told[dimension + c], 0));
    return moved > MOVED * size || (own.length > dimension && Math.acos(Math.min(along, 1)) > TURNED);
  });
  return wrong.length <= FAILING * inner.length;
}

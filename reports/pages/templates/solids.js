// Solids of bodies in space, drawn on a canvas as the outlines of points that a sphere is swept over, those behind first.
crossbody.solids = (() => {
  // Points of a circle of so many pixels, less than a tenth of a pixel off it.
  const circles = [];
  const circle = (r) => {
    const count = Math.max(8, Math.ceil(7 * Math.sqrt(r)));
    const turn = (k) => (2 * Math.PI * k) / count;
    return circles[count] ??= Array.from({ length: count }, (_, k) => [Math.cos(turn(k)), Math.sin(turn(k))]);
  };
  const unit = (p) => p.map((x) => x / (Math.hypot(...p) || 1));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const WORLD = { origin: [0, 0, 0], axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] };

  // Origin and axes of a body: nine numbers, its origin and its first two axes, which have become shorter between
  // two pictures and are brought to length 1 again.
  const frame = (pose, body) => {
    const three = (i) => [pose(9 * body + i), pose(9 * body + i + 1), pose(9 * body + i + 2)];
    const [x, leaning] = [unit(three(3)), three(6)];
    const along = dot(x, leaning);
    const y = unit(leaning.map((value, i) => value - along * x[i]));
    return { origin: three(0), axes: [x, y, cross(x, y)] };
  };
  const placed = ({ origin, axes }, p) => origin.map((x, i) => x + axes[0][i] * p[0] + axes[1][i] * p[1] + axes[2][i] * p[2]);
  const carried = (frame, plane) => {
    const [at, x, y] = [0, 3, 6].map((k) => placed(frame, plane.slice(k, k + 3)));
    return [...at, ...[x, y].flatMap((end) => end.map((value, i) => value - frame.origin[i]))];
  };
  const turning = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const outline = (points) => {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (list) => {
      const found = [];
      for (const p of list) {
        while (found.length > 1 && turning(found.at(-2), found.at(-1), p) <= 0) found.pop();
        found.push(p);
      }
      return found.slice(0, -1);
    };
    return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
  };
  const trace = (g, points) => {
    g.beginPath();
    points.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
  };

  // A square of lines on a plane, around what moves.
  const grid = (g, plane, to, middle, size, colour) => {
    const [origin, x, y] = [plane.slice(0, 3), plane.slice(3, 6), plane.slice(6, 9)];
    const away = middle.map((value, i) => value - origin[i]);
    const [u, w] = [dot(away, x), dot(away, y)];
    const point = (a, b) => to(origin.map((value, i) => value + (u + a * size) * x[i] + (w + b * size) * y[i]));
    g.strokeStyle = colour;
    g.lineWidth = 0.6;
    for (let k = -5; k <= 5; k += 1) {
      for (const line of [[point(k / 8, -0.625), point(k / 8, 0.625)], [point(-0.625, k / 8), point(0.625, k / 8)]]) {
        trace(g, line);
        g.stroke();
      }
    }
  };

  // A line on a body, and which of its points are not behind it: their normals, which follow them, lead to the eye.
  const seen = (line, frame, to) => line.map((m) => {
    const [at, out] = [to(placed(frame, m)), to(placed(frame, m.slice(0, 3).map((x, i) => x + m[3 + i])))];
    return [at[0], at[1], out[3] <= at[3]];
  });

  // Of the world: planes and shapes that stand still; of one track: its bodies.
  const paint = (g, shapes, frames, to, look) => {
    const drawn = shapes.map((solid) => {
      const points = solid.points.map((p) => to(placed(frames[solid.body] || WORLD, p)));
      return { ...solid, points, marks: (solid.marks || []).map((line) => seen(line, frames[solid.body] || WORLD, to)), depth: points.reduce((sum, p) => sum + p[3], 0) / points.length };
    });
    g.strokeStyle = look.ink;
    g.fillStyle = `color-mix(in srgb, ${look.ink} 22%, ${look.paper})`;
    for (const { points, radius, faces, marks } of drawn.sort((a, b) => b.depth - a.depth)) {
      const r = radius * points[0][2];
      const round = circle(r);
      const around = outline(r ? points.flatMap(([x, y]) => round.map(([c, s]) => [x + r * c, y + r * s])) : points);
      trace(g, around);
      g.closePath();
      if (!look.ghost) g.fill();
      g.lineJoin = r ? "miter" : "round"; // a round outline is smooth as it is
      g.lineWidth = look.width;
      g.stroke();
      if (!faces.length && !marks.length) continue;
      const dashes = g.getLineDash();
      g.setLineDash([]); // edges inside an outline are thin, and dashes cost more than lines
      g.lineWidth = 0.6 * look.width;
      g.beginPath();
      for (const line of marks) line.forEach(([x, y, shown], i) => (shown && line[i - 1]?.[2] ? g.lineTo(x, y) : g.moveTo(x, y)));
      for (const face of faces) {
        const corners = face.map((i) => points[i]);
        const area = corners.reduce((sum, p, i) => {
          const next = corners[(i + 1) % corners.length];
          return sum + p[0] * next[1] - p[1] * next[0];
        }, 0);
        if (area > 0) continue; // turned away
        corners.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
        g.closePath();
      }
      g.stroke();
      g.setLineDash(dashes);
    }
  };
  const bones = (g, pairs, frames, to) => {
    g.lineWidth = 1;
    for (const [one, two] of pairs) {
      trace(g, [to(frames[one].origin), to(frames[two].origin)]);
      g.stroke();
    }
  };
  const axes = (g, frames, to, length) => {
    g.lineWidth = 2;
    for (const { origin, axes: three } of frames) {
      three.forEach((axis, k) => {
        g.strokeStyle = ["#d33", "#292", "#36c"][k];
        trace(g, [to(origin), to(origin.map((x, i) => x + length * axis[i]))]);
        g.stroke();
      });
    }
  };
  // Corners of what a solid fills.
  const extent = (pose, { body, points, radius }) => points.flatMap((p) => {
    const at = placed(frame(pose, body), p);
    return [at.map((x) => x - radius), at.map((x) => x + radius)];
  });
  // The axes of a body whose turn from another's is larger by a factor: about the same axis, up to half a turn.
  const exaggerated = (from, axes, factor) => {
    const sine = [0, 1, 2].map((i) => 0.5 * from.reduce((sum, a, k) => sum + cross(a, axes[k])[i], 0));
    const [size, cosine] = [Math.hypot(...sine), 0.5 * (from.reduce((sum, a, k) => sum + dot(a, axes[k]), 0) - 1)];
    const angle = Math.min(factor * Math.atan2(size, cosine), Math.PI);
    const about = size > 0 ? sine.map((x) => x / size) : [0, 0, 1];
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return from.map((a) => {
      const [along, aside] = [dot(about, a), cross(about, a)];
      return a.map((x, i) => c * x + s * aside[i] + (1 - c) * along * about[i]);
    });
  };
  return { exaggerated, extent, frame, grid, carried, paint, bones, axes };
})();

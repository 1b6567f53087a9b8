// Playback: every engine's motion on a canvas, over the clock that the plots share.
(() => {
  const nice = (x) => {
    const ten = 10 ** Math.floor(Math.log10(x) + 1e-9);
    return ten * [1, 2, 5, 10].find((k) => k * ten >= x * 0.999);
  };
  const SHARP = 2; // device pixels a pixel at most; more cost time and are not seen in what moves
  const SAID = 100; // time between two readouts while it plays, ms: each has the page laid out and painted
  const [NARROW, BARS] = [560, 48]; // width of a picture whose bars would lie over the scene, and their height, pixels
  const EDGE = 10; // between an arrow and the border of its picture, pixels
  const FAR = 4; // times its own size that a mechanism goes before it is followed
  const shortNumber = (x) => String(Number(x.toPrecision(3)));

  const start = async (root) => {
    const scene = await crossbody.value(root.querySelector("[data-scene]"));
    const { stage, end } = scene;
    const fade = end / 25; // how long an impulse is seen
    const space = stage.dimensions === 3;
    const tracks = scene.tracks.map((track) => {
      const n = track.t.length;
      return { ...track, width: track.poses.length / n, pushes: track.arrows.length / n };
    });
    const find = (name) => root.querySelector(`[data-${name}]`);
    const [play, clock, readout, event, speed, view, forces, longer, axes, before, after, differences, whose, follow, alone] =
      ["play", "clock", "readout", "event", "speed", "view", "forces", "longer", "axes", "before", "after", "differences", "whose", "follow", "alone"].map(find);
    const canvas = root.querySelector("canvas");
    const g = canvas.getContext("2d", { alpha: false }); // what is opaque costs less to lay into the page
    let [now, running, last, said, turn, tilt, zoom] = [0, false, 0, -Infinity, 0.6, 0.35, 1];
    const box = { width: 0, height: 0 }; // of the canvas; told by an observer, for who asks has the page laid out
    const colours = {};
    const dye = () => {
      const style = getComputedStyle(document.documentElement);
      for (const name of ["ink", "paper", "soft", "line"]) colours[name] = style.getPropertyValue(`--${name}`).trim();
    };
    dye();
    const solids = stage.frames > 0; // bodies with shapes; otherwise points that are joined by lines
    const [fixed, moving] = [false, true].map((moves) => stage.solids.filter((s) => !s.plane && s.body >= 0 === moves));

    const lead = tracks.find((track) => track.truth);
    const at = (track, t) => {
      const times = track.t;
      let [low, high] = [0, times.length - 1];
      while (high - low > 1) {
        const half = (low + high) >> 1;
        if (times[half] <= t) low = half; else high = half;
      }
      const gap = times[high] - times[low];
      const share = gap > 0 ? Math.min(Math.max((t - times[low]) / gap, 0), 1) : 0;
      const mix = (k) => track.poses[low * track.width + k] * (1 - share) + track.poses[high * track.width + k] * share;
      const row = share < 1 ? low : high; // what has been, so that no force is seen before its touch
      return { pose: mix, pushes: track.arrows.subarray(row * track.pushes, (row + 1) * track.pushes) };
    };
    const larger = (track) => (differences && lead && (!whose.value || whose.value === track.name) ? Number(differences.value) : 1);
    // A pose with its difference to the truth's made larger: of bodies with shapes also how they are turned.
    const pose = (track, t) => {
      const [mine, factor] = [at(track, t), larger(track)];
      if (factor === 1 || track === lead) return mine;
      const true_ = at(lead, t).pose;
      const moved = (k) => true_(k) + factor * (mine.pose(k) - true_(k));
      const axes = Array.from({ length: stage.frames }, (_, body) => {
        const [from, to] = [true_, mine.pose].map((one) => crossbody.solids.frame(one, body).axes);
        return crossbody.solids.exaggerated(from, to, factor).flat();
      });
      return { ...mine, pose: (k) => (solids && k % 9 > 2 ? axes[Math.floor(k / 9)][(k % 9) - 3] : moved(k)) };
    };
    // Whose motion the view has room for: the truth's, for a run that diverged, or differences made larger, would shrink it.
    const fitted = lead ? [lead] : tracks;
    const around = (points) => {
      const found = [0, 1, 2].map(() => [Infinity, -Infinity]);
      for (const p of points) {
        for (let k = 0; k < p.length; k += 1) {
          if (Number.isFinite(p[k])) found[k] = [Math.min(found[k][0], p[k]), Math.max(found[k][1], p[k])];
        }
      }
      return found;
    };
    const reach = stage.bodies.map((shapes) => Math.max(0, ...shapes.flatMap((s) =>
      s.circle ? [Math.hypot(s.circle[0], s.circle[1]) + s.circle[2]] : s.points.map((p) => Math.hypot(...p)))));
    // Points that bodies reach at one instant.
    const reached = (track, t) => {
      const posed = at(track, t).pose;
      if (solids) return moving.flatMap((solid) => crossbody.solids.extent(posed, solid));
      return Array.from({ length: track.width / 3 }, (_, k) => [posed(3 * k), posed(3 * k + 1), posed(3 * k + 2)]).flatMap((p, k) =>
        (space ? [p] : [-1, 1].map((side) => [p[0] + side * reach[k], p[1] + side * reach[k]])));
    };
    const spans = () => around([
      ...fixed.flatMap((solid) => solid.points), ...stage.still.flatMap((shape) => shape.points || []),
      ...stage.threads.map((thread) => thread.slice(0, 2)),
      ...fitted.flatMap((track) => {
        const step = Math.max(1, Math.floor(track.t.length / (solids ? 40 : 150)));
        return [...track.t].filter((_, i) => i % step === 0).flatMap((t) => reached(track, t));
      }),
    ]);
    // Diameter seen from above, and height: what a camera that goes round and over it must have room for.
    const across = ([x, y, z]) => [Math.hypot(x[1] - x[0], y[1] - y[0]), z[1] - z[0]];
    const centre = (boxes) => boxes.map(([a, b]) => (a + b) / 2);
    const range = spans();
    let middle, size;
    // What the bodies span at one instant: one that goes far is followed, or nobody would see it.
    const standing = (t) => around(fitted.flatMap((track) => reached(track, t)));
    const aim = () => {
      const boxes = follow?.checked ? standing(now) : range;
      middle = centre(boxes);
      size = space ? across(boxes).map((x) => (follow?.checked ? 1.3 : 1) * x) : [0, 0];
    };
    const camera = (x0, y0, w, h) => {
      if (!space) {
        const [wide, tall] = [range[0][1] - range[0][0] || 1, range[1][1] - range[1][0] || 1];
        const scale = 0.86 * zoom * Math.min(w / wide, (h - 18) / tall);
        return (p) => [x0 + w / 2 + (p[0] - middle[0]) * scale, y0 + (h + 14) / 2 - (p[1] - middle[1]) * scale, scale];
      }
      const [ca, sa, cb, sb] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
      const tall = Math.abs(cb) * size[1] + Math.abs(sb) * size[0];
      const scale = 0.9 * zoom * Math.min(w / (size[0] || 1), (h - 14) / (tall || 1));
      const up = stage.down ? -1 : 1;
      return (p) => {
        const [x, y, z] = [p[0] - middle[0], p[1] - middle[1], up * (p[2] - middle[2])];
        const [right, deep] = [ca * x - up * sa * y, sa * x + up * ca * y];
        return [x0 + w / 2 + right * scale, y0 + (h + 14) / 2 - (cb * z + sb * deep) * scale, scale, cb * deep - sb * z];
      };
    };
    const trace = (points) => {
      g.beginPath();
      points.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
    };
    const shape = (s, move, to, ghost) => {
      if (s.circle) {
        const [x, y, scale] = to(move(s.circle));
        g.beginPath();
        g.arc(x, y, Math.max(s.circle[2] * scale, 0.5), 0, 2 * Math.PI);
      } else {
        trace(s.points.map((p) => to(move(p))));
        if (s.closed) g.closePath();
      }
      if (s.fill && !ghost) {
        g.globalAlpha = 0.25;
        g.fill();
        g.globalAlpha = 1;
      }
      g.stroke();
    };
    // The part of an arrow that is within its picture; nothing where it begins outside.
    const inside = (from, to, frame) => [0, 1].reduce((part, k) => {
      const [low, high] = [frame[k] + EDGE, frame[k] + frame[k + 2] - EDGE];
      if (!(from[k] >= low && from[k] <= high)) return 0;
      return to[k] < low ? Math.min(part, (from[k] - low) / (from[k] - to[k])) : to[k] > high ? Math.min(part, (high - from[k]) / (to[k] - from[k])) : part;
    }, 1);
    // A bar across an arrow that is shorter than its force is large.
    const bar_ = (from, to) => {
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      const [x, y, long] = [from[0] + 0.4 * dx, from[1] + 0.4 * dy, Math.hypot(dx, dy) / 6];
      if (long < 0.4) return;
      trace([[x - dy / long, y + dx / long], [x + dy / long, y - dx / long]]);
      g.stroke();
    };
    const arrow = (from, to, hollow) => {
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      const length = Math.hypot(dx, dy);
      if (length < 2) return;
      if (hollow) {
        // The outline of a broad arrow: an impulse.
        const [x, y, tip] = [dx / length, dy / length, Math.min(14, 0.5 * length)];
        const at = (along, across) => [from[0] + along * x - across * y, from[1] + along * y + across * x];
        trace([at(0, 4), at(length - tip, 4), at(length - tip, 9), at(length, 0), at(length - tip, -9), at(length - tip, -4), at(0, -4)]);
        g.closePath();
        g.stroke();
        return;
      }
      const [ux, uy, head] = [dx / length, dy / length, Math.min(8, 0.6 * length)];
      trace([from, to]);
      g.stroke();
      g.beginPath();
      g.moveTo(to[0], to[1]);
      g.lineTo(to[0] - head * ux + 0.45 * head * uy, to[1] - head * uy - 0.45 * head * ux);
      g.lineTo(to[0] - head * ux - 0.45 * head * uy, to[1] - head * uy + 0.45 * head * ux);
      g.fill();
    };
    // Forces, or impulses as hollow arrows; the typical largest of them is drawn as long as 0.28 of the height.
    const arrows = (to, frame, largest, values, hollow) => {
      const h = frame[3];
      const n = stage.dimensions;
      for (let k = 0; k < values.length && largest; k += 2 * n) {
        const [point, force] = [values.subarray(k, k + n), values.subarray(k + n, k + 2 * n)];
        const from = to(point);
        const unit = ((0.28 * h) / largest / (from[2] || 1)) * Number(longer.value);
        const long = Math.hypot(...force) * unit * from[2];
        const cut = long > 0.45 * h ? (0.45 * h) / long : 1;
        const end_ = to([...point].map((x, i) => x + force[i] * unit * cut));
        const part = inside(from, end_, frame);
        const tip = from.slice(0, 2).map((x, i) => x + part * (end_[i] - x));
        arrow(from, tip, hollow);
        if (cut * part < 1) bar_(from, tip);
      }
    };
    const paintSolids = (track, pose, to, ghost) => {
      const frames = Array.from({ length: stage.frames }, (_, body) => crossbody.solids.frame(pose, body));
      const look = { ink: track.color, paper: colours.paper, width: track.truth ? 2 : 1.4, ghost };
      for (const { plane, body } of ghost ? [] : stage.solids) { // planes that bodies carry
        if (plane && body >= 0) crossbody.solids.grid(g, crossbody.solids.carried(frames[body], plane), to, middle, 0.5 * Math.hypot(...size), colours.line);
      }
      crossbody.solids.paint(g, moving, frames, to, look);
      crossbody.solids.bones(g, stage.bones, frames, to);
      if (axes.checked) crossbody.solids.axes(g, frames, to, 0.06 * Math.hypot(...size));
    };
    const paint = (track, to, frame, ghost) => {
      const { pose: posed, pushes } = pose(track, now);
      g.strokeStyle = g.fillStyle = track.color;
      g.lineWidth = track.truth ? 4 : 1.8;
      g.setLineDash(ghost && track.strokes !== "none" ? track.strokes.split(" ").map(Number) : []);
      if (solids) paintSolids(track, posed, to, ghost);
      else if (space) {
        for (const line of stage.lines) {
          trace(line.map((i) => to([posed(3 * i), posed(3 * i + 1), posed(3 * i + 2)])));
          g.stroke();
        }
      } else {
        for (const [x, y, body] of stage.threads) {
          trace([to([x, y]), to([posed(3 * body), posed(3 * body + 1)])]);
          g.stroke();
        }
        stage.bodies.forEach((shapes, body) => {
          const [x, y, angle] = [posed(3 * body), posed(3 * body + 1), posed(3 * body + 2)];
          const [c, s] = [Math.cos(angle), Math.sin(angle)];
          const move = (p) => [x + c * p[0] - s * p[1], y + s * p[0] + c * p[1]];
          shapes.forEach((each) => shape(each, move, to, ghost));
        });
      }
      g.setLineDash([]);
      if (!forces.checked) return;
      g.lineWidth = 2;
      arrows(to, frame, scene.force, pushes, false);
      const each = track.struck.length ? track.blows.length / track.struck.length : 0;
      track.struck.forEach((t, i) => {
        if (now < t || now > t + fade) return;
        g.globalAlpha = 1 - (now - t) / fade;
        arrows(to, frame, scene.impulse, track.blows.subarray(i * each, (i + 1) * each), true);
        g.globalAlpha = 1;
      });
    };
    const still = (to) => {
      g.strokeStyle = g.fillStyle = colours.soft;
      g.lineWidth = 1.2;
      stage.still.forEach((each) => shape(each, (p) => p, to, true));
      for (const { plane, body } of stage.solids) if (plane && body < 0) crossbody.solids.grid(g, plane, to, middle, Math.hypot(...size), colours.line);
      crossbody.solids.paint(g, fixed, [], to, { ink: colours.soft, paper: colours.paper, width: 1, ghost: false });
    };
    const bar = (to, x, y, h) => {
      // A length, a force and an impulse to measure by.
      const scale = to([middle[0], middle[1], middle[2] || 0])[2];
      g.fillStyle = g.strokeStyle = colours.soft;
      g.lineWidth = 2;
      g.font = "12px system-ui, sans-serif";
      let line = y;
      const measure = (pixels, unit) => {
        const value = nice(60 / pixels);
        trace([[x, line], [x + value * pixels, line]]);
        g.stroke();
        const label = [`${shortNumber(value)} ${unit}`, x + value * pixels + 6, line + 4];
        g.strokeStyle = colours.paper; // what is drawn behind must not cross the text out
        g.lineWidth = 5;
        g.strokeText(...label);
        g.strokeStyle = colours.soft;
        g.lineWidth = 2;
        g.fillText(...label);
        line -= 16;
      };
      measure(scale, "m");
      if (!forces.checked) return;
      const longest = 0.28 * h * Number(longer.value);
      if (scene.force) measure(longest / scene.force, "N");
      if (scene.impulse) measure(longest / scene.impulse, "N s");
    };
    const draw = () => {
      aim();
      const dpr = Math.min(devicePixelRatio || 1, SHARP);
      if (!box.width) return;
      if (canvas.width !== Math.round(box.width * dpr)) canvas.width = Math.round(box.width * dpr);
      if (canvas.height !== Math.round(box.height * dpr)) canvas.height = Math.round(box.height * dpr);
      g.setTransform(dpr, 0, 0, dpr, 0, 0);
      g.fillStyle = colours.paper;
      g.fillRect(0, 0, box.width, box.height);
      g.lineJoin = g.lineCap = "round";
      const shown = tracks.filter((track) => crossbody.shown(track.name));
      if (view.value === "ghosts") {
        const to = camera(0, 0, box.width, box.height - (box.width < NARROW ? BARS : 0));
        still(to);
        shown.forEach((track, i) => paint(track, to, [0, 0, box.width, box.height], i > 0));
        bar(to, 12, box.height - 12, box.height);
      } else if (shown.length) {
        const columns = Math.max(1, Math.min(shown.length, Math.round(Math.sqrt((shown.length * box.width) / box.height))));
        const [w, h] = [box.width / columns, box.height / Math.ceil(shown.length / columns)];
        shown.forEach((track, i) => {
          const [x, y] = [(i % columns) * w, Math.floor(i / columns) * h];
          g.save();
          g.beginPath();
          g.rect(x, y, w, h);
          g.clip();
          const to = camera(x, y, w, h);
          still(to);
          paint(track, to, [x, y, w, h], false);
          g.fillStyle = colours.ink;
          g.font = "12px system-ui, sans-serif";
          g.fillText(track.name, x + 8, y + 15);
          g.restore();
        });
      }
      if (running && last - said < SAID) return;
      said = last;
      readout.textContent = `t = ${now.toFixed(Math.max(0, 4 - Math.floor(Math.log10(end || 1))))} s`;
      clock.value = end ? (1000 * now) / end : 0;
      const here = stops.find(({ t }) => Math.abs(t - now) <= close);
      event.textContent = here && !running ? told(here) : "";
      before.disabled = !stops.some(({ t }) => t < now - close);
      after.disabled = !stops.some(({ t }) => t > now + close);
    };
    // Instants at which something happens in an engine that is shown: those of the truth, each with what happens in others
    // within half a frame of it, and of all else what is within a frame is one.
    const close = 1e-9 * (end || 1);
    const instants = () => {
      const shown = tracks.filter((track) => (alone?.checked ? track === lead : crossbody.shown(track.name)));
      const each = (track) => track.happens[0].map((t, i) => ({ t, who: track.name, what: track.happens[1][i] }));
      const found = shown.filter((track) => track === lead).flatMap(each).map((one) => ({ t: one.t, all: [one] }));
      const rest = shown.filter((track) => track !== lead).flatMap(each).sort((a, b) => a.t - b.t).filter((one) => {
        const far = ({ t, all }) => Math.abs(t - one.t) + (all[0].what === one.what ? 0 : scene.frame); // its like first
        const near = found.filter(({ t }) => Math.abs(t - one.t) <= 0.5 * scene.frame).sort((a, b) => far(a) - far(b))[0];
        near?.all.push(one);
        return !near;
      });
      const own = [];
      for (const one of rest) {
        if (own.length && one.t - own.at(-1).t <= scene.frame) own.at(-1).all.push(one);
        else own.push({ t: one.t, all: [one] });
      }
      return [...found, ...own].sort((a, b) => a.t - b.t);
    };
    let stops = instants();
    crossbody.on("engines", () => { stops = instants(); });
    alone?.addEventListener("change", () => { stops = instants(); redraw(); });
    const told = ({ all }) => {
      const groups = new Map();
      all.forEach(({ what, who }) => groups.set(what, (groups.get(what) || new Set()).add(who)));
      const texts = [...groups].map(([what, whom]) => `${what} (${[...whom].slice(0, 2).join(", ")}${whom.size > 2 ? ` and ${whom.size - 2} more` : ""})`);
      return texts.slice(0, 3).join("; ") + (texts.length > 3 ? `; and ${texts.length - 3} more` : "");
    };
    let wanted = false;
    const redraw = () => {
      if (wanted) return;
      wanted = true;
      requestAnimationFrame(() => { wanted = false; draw(); });
    };
    const seek = (t, tell) => {
      now = Math.min(Math.max(t, 0), end);
      redraw();
      if (tell) crossbody.tell("time", now, root);
    };
    const frame = (stamp) => {
      if (!running) return;
      const t = now + (Math.min(stamp - last, 100) / 1000) * Number(speed.value);
      [last, now] = [stamp, t >= end ? 0 : t];
      draw();
      crossbody.tell("time", now, root);
      requestAnimationFrame(frame);
    };
    const run = (go) => {
      running = go;
      play.textContent = go ? "Pause" : "Play";
      play.setAttribute("aria-pressed", go);
      last = performance.now();
      if (go) requestAnimationFrame(frame);
      else redraw();
    };

    if (follow && moving.length) follow.checked = Math.hypot(...across(range)) > FAR * Math.hypot(...across(standing(0)));
    const usual = nice((end || 1) / 10);
    const paces = [0.01, 0.1, 0.2, 0.5, 1, 2, 5].map((factor) => usual * factor);
    const paced = (pace) => (pace === 1 ? "real time" : pace < 1 ? `${shortNumber(1 / pace)} × slower` : `${shortNumber(pace)} × faster`);
    for (const pace of [...new Set([...paces, 1])].sort((a, b) => a - b)) {
      speed.append(new Option(paced(pace), pace, pace === usual, pace === usual));
    }
    play.addEventListener("click", () => run(!running));
    clock.addEventListener("input", () => seek((clock.value / 1000) * end, true));
    const step = (found) => { if (found) { run(false); seek(found.t, true); } };
    before.addEventListener("click", () => step(stops.findLast(({ t }) => t < now - close)));
    after.addEventListener("click", () => step(stops.find(({ t }) => t > now + close)));
    differences?.addEventListener("change", () => { whose.disabled = Number(differences.value) === 1; });
    [view, forces, longer, axes, differences, whose, follow].filter(Boolean).forEach((field) => field.addEventListener("change", redraw));
    const look = (right, down, closer = 1) => {
      if (space) [turn, tilt] = [turn + right, Math.min(1.5, Math.max(-1.5, tilt + down))];
      zoom = Math.min(50, Math.max(0.2, zoom * closer));
      redraw();
    };
    const held = new Map(); // pointers that are down: one turns, two come nearer
    const between = () => { const [a, b] = [...held.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.style.touchAction = space ? "none" : "pan-y";
    canvas.addEventListener("pointerdown", (event) => {
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
      canvas.setPointerCapture(event.pointerId);
    });
    for (const end_ of ["pointerup", "pointercancel"]) canvas.addEventListener(end_, (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const was = held.get(event.pointerId);
      if (!was) return;
      const wide = held.size === 2 ? between() : 0;
      held.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (wide) look(0, 0, between() / wide);
      else if (held.size === 1) look((event.clientX - was.x) * 0.01, (event.clientY - was.y) * 0.01);
    });
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas) return; // a page is scrolled past a picture that nobody has touched
      event.preventDefault();
      look(0, 0, Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { [turn, tilt, zoom] = [0.6, 0.35, 1]; redraw(); });
    const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1],
      "+": [0, 0, 1.2], "=": [0, 0, 1.2], "-": [0, 0, 1 / 1.2] };
    const does = { " ": () => run(!running), ",": () => before.click(), ".": () => after.click() };
    canvas.addEventListener("keydown", (event) => {
      const moved = keys[event.key];
      if (!does[event.key] && (!moved || (!space && moved.length < 3))) return;
      event.preventDefault();
      if (moved) look(...moved);
      else does[event.key]();
    });
    crossbody.on("time", (t, from) => { if (from !== root && root.closest("[data-page]").contains(from)) seek(t, false); });
    for (const what of ["engines", "page"]) crossbody.on(what, redraw);
    crossbody.on("theme", () => { dye(); draw(); }); // at once: a print does not wait for a frame
    new ResizeObserver(([{ contentRect }]) => {
      [box.width, box.height] = [contentRect.width, contentRect.height];
      draw();
    }).observe(canvas);
  };
  crossbody.each(".player", start);
})();

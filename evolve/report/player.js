// A playable episode: images, the world from above, what each eye signals, and the reward so far.
// The film (evolve/report/player.py) is stored as JSON inside the player's element.
"use strict";
(() => {
  const TAU = 2 * Math.PI;
  const TERM_COLOURS = ["accent", "green", "vermillion", "purple"];

  function colours(element) {
    const style = getComputedStyle(element);
    const names = ["ink", "muted", "line", "paper", "panel", "wall", "accent", "vermillion", "green", "purple"];
    return Object.fromEntries(names.map((name) => [name, style.getPropertyValue("--" + name).trim()]));
  }

  // A canvas's 2-D context in CSS pixels, sharp on any screen.
  function sharp(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = "12px " + getComputedStyle(canvas).fontFamily;
    return { context, width, height };
  }

  // World coordinates [m] (y up) to pixels, the whole world in view.
  function projection(bounds, width, height) {
    const [x0, y0, x1, y1] = bounds;
    const scale = Math.min(width / (x1 - x0), height / (y1 - y0));
    const left = (width - scale * (x1 - x0)) / 2, top = (height - scale * (y1 - y0)) / 2;
    return { scale, x: (x) => left + scale * (x - x0), y: (y) => top + scale * (y1 - y) };
  }

  // Rendered images of the animal at its task.
  function drawPicture(canvas, film, frame, sheet) {
    if (!sheet.complete || !sheet.naturalWidth) return;
    const { context: c, width, height } = sharp(canvas);
    const [h, w] = film.pictures.size, shown = film.pictures.shown[frame], columns = film.pictures.columns;
    c.drawImage(sheet, (shown % columns) * w, Math.floor(shown / columns) * h, w, h, 0, 0, width, height);
  }

  function commands(film, frame) {
    if (film.action)
      return "action " + film.action[frame].slice(0, 8).map((a) => a.toFixed(2).replace("-", "\u2212")).join(", ");
    const turn = film.turn_deg[frame], side = turn < 0 ? "right" : "left";
    return `commands ${film.speed[frame].toFixed(1)} m/s and ${Math.abs(turn).toFixed(0)}\u00b0 to the ${side}`;
  }

  function drawWorld(canvas, film, frame, colour) {
    const { context: c, width, height } = sharp(canvas);
    const at = projection(film.bounds, width, height);
    c.fillStyle = colour.panel;
    const [x0, y0, x1, y1] = film.bounds;
    c.fillRect(at.x(x0), at.y(y1), at.scale * (x1 - x0), at.scale * (y1 - y0));
    drawRegion(c, film.goal_region, at, colour);
    c.fillStyle = colour.wall;
    for (const [cx, cy, hx, hy] of film.walls)  // half a pixel larger, to avoid visible seams between neighbours
      c.fillRect(at.x(cx - hx) - 0.25, at.y(cy + hy) - 0.25, 2 * hx * at.scale + 0.5, 2 * hy * at.scale + 0.5);
    drawPath(c, film, film.position.length - 1, at, colour.line, 1.5);
    drawFields(c, film, frame, at, colour);
    drawPath(c, film, frame, at, colour.ink, 1.5);
    drawEvents(c, film, frame, at, colour);
    drawObjects(c, film, frame, at, colour);
    drawAgent(c, film, frame, at, colour);
  }

  function drawRegion(c, region, at, colour) {
    if (!region) return;
    const [x0, y0, x1, y1] = region;
    c.fillStyle = colour.green;
    c.globalAlpha = 0.25;
    c.fillRect(at.x(x0), at.y(y1), (x1 - x0) * at.scale, (y1 - y0) * at.scale);
    c.globalAlpha = 1;
  }

  function drawPath(c, film, last, at, stroke, lineWidth) {
    c.beginPath();
    for (let i = 0; i <= last; i++) c.lineTo(at.x(film.position[i][0]), at.y(film.position[i][1]));
    c.strokeStyle = stroke;
    c.lineWidth = lineWidth;
    c.lineJoin = "round";
    c.stroke();
  }

  // Each eye's horizontal field of view, as a sector.
  function drawFields(c, film, frame, at, colour) {
    const [x, y] = film.position[frame];
    const reach = 0.28 * Math.min(c.canvas.clientWidth, c.canvas.clientHeight);
    const half = film.fov / 2;
    for (const azimuth of film.azimuths) {
      const axis = film.heading[frame] + azimuth;
      c.beginPath();
      c.moveTo(at.x(x), at.y(y));
      c.arc(at.x(x), at.y(y), reach, -axis - half, -axis + half);
      c.closePath();
      c.globalAlpha = 0.16;
      c.fillStyle = colour.accent;
      c.fill();
      c.globalAlpha = 0.6;
      c.strokeStyle = colour.accent;
      c.lineWidth = 0.75;
      c.stroke();
      c.globalAlpha = 1;
    }
  }

  // Where the goal or an adversary has been reached so far.
  function drawEvents(c, film, frame, at, colour) {
    for (const [when, kind] of film.events) {
      if (when > frame) break;
      const [x, y] = film.position[when];
      c.beginPath();
      c.arc(at.x(x), at.y(y), 5, 0, TAU);
      c.strokeStyle = kind === "goal" ? colour.green : colour.vermillion;
      c.lineWidth = 2;
      c.stroke();
    }
  }

  function drawObjects(c, film, frame, at, colour) {
    c.textAlign = "center";
    c.textBaseline = "middle";
    film.object_names.forEach((name, i) => {
      const [x, y] = film.objects[frame][i];
      const goal = name.startsWith("goal");
      const radius = Math.max(film.object_radius[i] * at.scale, 7);
      c.beginPath();
      c.arc(at.x(x), at.y(y), radius, 0, TAU);
      c.fillStyle = goal ? colour.green : colour.vermillion;
      c.fill();
      c.fillStyle = colour.paper;
      c.fillText(goal ? "G" : "A", at.x(x), at.y(y) + 0.5);
    });
  }

  // The size has a minimum for visibility, so in a large world it is not to scale.
  function drawAgent(c, film, frame, at, colour) {
    const [x, y] = film.position[frame], heading = film.heading[frame];
    const radius = Math.max(film.body_radius * at.scale, 6);
    c.save();
    c.translate(at.x(x), at.y(y));
    c.rotate(-heading);
    c.beginPath();
    c.moveTo(radius * 1.9, 0);
    c.lineTo(0, radius);
    c.arc(0, 0, radius, TAU / 4, 3 * TAU / 4);
    c.closePath();
    c.fillStyle = colour.ink;
    c.strokeStyle = colour.paper;
    c.lineWidth = 1.5;
    c.fill();
    c.stroke();
    c.restore();
  }

  function ticks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high + 1e-9; k++) found.push(k * step);
    return found;
  }

  const short = (value) => String(+value.toPrecision(4)).replace("-", "\u2212");

  // Cumulated reward terms and their sum against time, with a cursor.
  function drawRewards(canvas, film, frame, colour) {
    const { context: c, width, height } = sharp(canvas);
    const box = { left: 44, right: width - 8, top: 8, bottom: height - 32 };
    const series = [...Object.values(film.terms), film.total];
    let low = Math.min(0, ...series.flat()), high = Math.max(0, ...series.flat());
    if (high - low < 1e-9) high = low + 1;
    const pad = 0.05 * (high - low);
    low -= pad;
    high += pad;
    const end = film.times[film.times.length - 1] || 1;
    const x = (t) => box.left + (box.right - box.left) * (t / end);
    const y = (r) => box.bottom - (box.bottom - box.top) * ((r - low) / (high - low));
    drawAxes(c, box, ticks(0, end, 6), ticks(low, high, 4), x, y, colour);
    series.forEach((values, i) => {
      const total = i === series.length - 1;
      c.beginPath();
      values.forEach((value, k) => c.lineTo(x(film.times[k]), y(value)));
      c.strokeStyle = total ? colour.ink : colour[TERM_COLOURS[i % TERM_COLOURS.length]];
      c.lineWidth = total ? 2 : 1.25;
      c.stroke();
    });
    c.beginPath();
    c.moveTo(x(film.times[frame]), box.top);
    c.lineTo(x(film.times[frame]), box.bottom);
    c.strokeStyle = colour.muted;
    c.lineWidth = 1;
    c.stroke();
  }

  function drawAxes(c, box, xs, ys, x, y, colour) {
    c.lineWidth = 0.6;
    c.strokeStyle = colour.line;
    c.fillStyle = colour.muted;
    c.textBaseline = "middle";
    c.textAlign = "right";
    for (const value of ys) {
      c.beginPath();
      c.moveTo(box.left, y(value));
      c.lineTo(box.right, y(value));
      c.stroke();
      c.fillText(short(value), box.left - 6, y(value));
    }
    c.textAlign = "center";
    for (const value of xs) c.fillText(short(value), x(value), box.bottom + 10);
    c.fillText("time [s]", (box.left + box.right) / 2, box.bottom + 25);
  }

  function start(root) {
    const film = JSON.parse(root.querySelector("script.film").textContent);
    const find = (selector) => root.querySelector(selector);
    const slider = find("input[type=range]"), button = find("button.play"), speed = find("select");
    const last = film.times.length - 1;
    const sheets = Object.fromEntries(Object.entries(film.sheets).map(([name, source]) => {
      const image = new Image();
      image.addEventListener("load", () => draw());
      image.src = source;
      return [name, image];
    }));
    let frame = 0, playing = false, clock = 0, colour = colours(root);

    function drawEyes() {
      const [height, width] = film.eyes.resolution, n = film.eyes.count;
      for (const canvas of root.querySelectorAll("canvas[data-eye]")) {
        const sheet = sheets[canvas.dataset.sheet];
        if (!sheet.complete || !sheet.naturalWidth) continue;
        const column = (frame % film.sheet_columns) * n + Number(canvas.dataset.eye);
        const row = Math.floor(frame / film.sheet_columns);
        canvas.getContext("2d").drawImage(sheet, column * width, row * height, width, height, 0, 0, width, height);
      }
    }

    function write() {
      slider.value = frame;
      slider.setAttribute("aria-valuetext", film.times[frame].toFixed(1) + " seconds");
      root.dataset.frame = frame;
      find(".time").textContent = `${film.times[frame].toFixed(1)} s of ${film.times[last].toFixed(1)} s`;
      find(".action").textContent = commands(film, frame);
      for (const cell of root.querySelectorAll("[data-term]")) {
        const values = cell.dataset.term === "total" ? film.total : film.terms[cell.dataset.term];
        cell.textContent = values[frame].toFixed(2).replace("-", "\u2212");
      }
    }

    function draw() {
      if (film.pictures) drawPicture(find("canvas.pictures"), film, frame, sheets.pictures);
      if (film.bounds) drawWorld(find("canvas.world"), film, frame, colour);
      drawRewards(find("canvas.rewards"), film, frame, colour);
      drawEyes();
      write();
    }

    function show(next) {
      frame = Math.max(0, Math.min(last, next));
      draw();
    }

    function play(on) {
      playing = on;
      if (on && frame === last) show(0);
      clock = performance.now() - (1000 * film.times[frame]) / Number(speed.value);
      button.textContent = on ? "Pause" : "Play";
      button.setAttribute("aria-pressed", on);
      root.dataset.playing = on;
      if (on) requestAnimationFrame(tick);
    }

    function tick() {
      if (!playing) return;
      const time = ((performance.now() - clock) / 1000) * Number(speed.value);
      let next = frame;
      while (next < last && film.times[next + 1] <= time) next++;
      if (next !== frame) show(next);
      if (frame === last) play(false);
      else requestAnimationFrame(tick);
    }

    function key(event) {
      const inside = root.contains(event.target);
      if (event.altKey || event.ctrlKey || event.metaKey || event.target === speed) return;
      const step = event.shiftKey ? 10 : 1;
      if (!inside) return;  // let the page scroll
      const moves = { ArrowLeft: frame - step, ArrowRight: frame + step, Home: 0, End: last };
      if (event.key in moves) {
        play(false);
        show(moves[event.key]);
      } else if (event.key === " " && event.target !== button) play(!playing);
      else return;
      event.preventDefault();
    }

    slider.max = last;
    slider.addEventListener("input", () => { play(false); show(Number(slider.value)); });
    button.addEventListener("click", () => play(!playing));
    speed.addEventListener("change", () => play(playing));
    document.addEventListener("keydown", key);
    new ResizeObserver(draw).observe(root);
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => { colour = colours(root); draw(); });
    show(0);
  }

  document.querySelectorAll(".player").forEach(start);
})();

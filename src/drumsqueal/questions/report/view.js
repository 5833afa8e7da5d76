"use strict";
(() => {
  const element = (name) => document.getElementById(name);

  // Figures, enlarged.
  const dialog = element("zoom"), zoomed = element("zoomed"), pane = element("pane");
  const STEP = 1.5, MOST = 4;
  let scale = 0; // of the figure's own points; 0 fits it into the window
  const show = () => {
    zoomed.classList.toggle("fit", scale === 0);
    zoomed.style.width = scale === 0 ? "" : `${Math.round(scale * zoomed.naturalWidth)}px`;
    element("zoom-scale").textContent = scale === 0 ? "fits" : `${Math.round(100 * scale)} %`;
  };
  const change = (factor) => {
    const now = zoomed.clientWidth / zoomed.naturalWidth;
    const x = (pane.scrollLeft + pane.clientWidth / 2) / Math.max(pane.scrollWidth, 1);
    const y = (pane.scrollTop + pane.clientHeight / 2) / Math.max(pane.scrollHeight, 1);
    scale = Math.min(MOST, Math.max(0.1, now * factor));
    show();
    pane.scrollLeft = x * pane.scrollWidth - pane.clientWidth / 2;
    pane.scrollTop = y * pane.scrollHeight - pane.clientHeight / 2;
  };
  for (const button of document.querySelectorAll(".enlarge")) {
    const figure = element(button.dataset.figure);
    const open = () => {
      button.focus(); // to which the focus returns
      zoomed.src = figure.src;
      zoomed.alt = figure.alt;
      element("zoom-title").textContent = element(`${figure.id}-title`).textContent;
      scale = 0;
      show();
      dialog.showModal();
      element("close").focus();
    };
    button.addEventListener("click", open);
    figure.addEventListener("click", open);
  }
  element("larger").addEventListener("click", () => change(STEP));
  element("smaller").addEventListener("click", () => change(1 / STEP));
  element("fit").addEventListener("click", () => { scale = 0; show(); });
  element("close").addEventListener("click", () => dialog.close());
  pane.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return; // which a pinch on a touchpad sets
    event.preventDefault();
    change(Math.exp(-event.deltaY / 200));
  }, { passive: false });

  // Modes, moving.
  const source = element("animation");
  if (!source) return;
  const data = JSON.parse(source.textContent), play = element("play"), slider = element("phase");
  const still = window.matchMedia("(prefers-reduced-motion: reduce)");
  let mode = null, lines = [], phase = 0, last = null, running = false;

  const make = (kind, name, group, values) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
    made.setAttribute("class", name);
    for (const [key, value] of Object.entries(values)) made.setAttribute(key, value);
    return group.appendChild(made);
  };
  const ring = (x, y, radius) =>
    `M${x + radius} ${y}A${radius} ${radius} 0 1 0 ${x - radius} ${y}A${radius} ${radius} 0 1 0 ${x + radius} ${y}Z`;
  const points = (at, line, real, imaginary) => {
    const out = [];
    for (let k = 0; k < at.length; k += 2) {
      const x = at[k] + real * line.re[k] - imaginary * line.im[k];
      const y = at[k + 1] + real * line.re[k + 1] - imaginary * line.im[k + 1];
      out.push(`${x.toFixed(2)},${(-y).toFixed(2)}`); // y is upwards
    }
    return out.join(" ");
  };
  const kindOf = (index) => {
    if (mode.flat) return index === 0 ? "front" : "cross";
    return index === 0 ? "back" : index === 1 ? "front" : "edge";
  };
  const drawAxes = (group) => {
    const length = 0.3 * data.radius;
    const axes = { x: [1, 0], y: [0, 1] };
    if (mode.depth.length) { // z comes forward
      const size = Math.hypot(...mode.depth);
      axes.z = [0.7 * mode.depth[0] / size, 0.7 * mode.depth[1] / size];
    }
    for (const [name, [right, up]] of Object.entries(axes)) {
      const size = Math.hypot(right, up), place = (along, aside) =>
        `${(along * right * length - aside * up / size).toFixed(2)},${(-(along * up * length + aside * right / size)).toFixed(2)}`;
      make("polyline", "axis", group, { points: `0,0 ${place(1, 0)}` });
      make("polygon", "tip", group, { points: [place(1.2, 0), place(1, 2.2), place(1, -2.2)].join(" ") });
      const [x, y] = place(1.2 + 0.22 / size, 0).split(",");
      make("text", "axis-name", group, { x, y }).textContent = name;
    }
  };
  const drawDrum = () => {
    const group = element("drum"), { radius, outer } = data, mean = mode.flat ? (radius + outer) / 2 : 0.96 * radius;
    group.replaceChildren();
    const [x, y] = mode.depth.length ? mode.depth : [0, 0];
    if (mode.flat) make("path", "ring", group, { d: ring(0, 0, outer) + ring(0, 0, radius) });
    else for (const sign of [-1, 1]) make("circle", "rim", group, { cx: sign * x, cy: -sign * y, r: radius });
    drawAxes(group);
    if (data.turns === 0) return;
    // The way it turns, on the side where the shoe is not.
    const place = (angle, distance) => `${(x + distance * Math.cos(angle)).toFixed(2)},${(-y - distance * Math.sin(angle)).toFixed(2)}`;
    const angles = Array.from({ length: 21 }, (_, k) => Math.PI + 0.05 * data.turns * (k - 10)), end = angles[20];
    make("polyline", "arrow", group, { points: angles.map((angle) => place(angle, mean)).join(" ") });
    const tip = [place(end + 0.09 * data.turns, mean), place(end, mean + 3), place(end, mean - 3)];
    make("polygon", "tip", group, { points: tip.join(" ") });
  };
  const draw = () => {
    const angle = (2 * Math.PI * phase) / 360, real = Math.cos(angle), imaginary = Math.sin(angle);
    mode.lines.forEach((line, k) => lines[k].setAttribute("points", points(line.at, line, real, imaginary)));
    slider.value = Math.floor(phase) % 360;
    slider.setAttribute("aria-valuetext", `${slider.value} degrees`);
  };
  const rate = (value) => value === 0 ? "0" : `${value < 0 ? "−" : "+"}${Number(Math.abs(value).toPrecision(4))}`;
  const choose = (index) => {
    mode = data.modes[index];
    drawDrum();
    const rest = element("rest"), now = element("now");
    rest.replaceChildren();
    now.replaceChildren();
    mode.lines.forEach((line) => make("polyline", "at-rest", rest, { points: points(line.at, line, 0, 0) }));
    lines = mode.lines.map((line, k) => make("polyline", `moves ${kindOf(k)}`, now, {}));
    const shares = Object.entries(mode.shares).map(([name, share]) => `${name} ${Number((100 * share).toPrecision(3))} %`);
    const view = mode.flat ? "Section through the middle of the shoe." : "Oblique view, because the shoe moves out of its plane.";
    element("mode-text").textContent =
      `Mode ${mode.label}: ${Math.round(mode.frequency_Hz)} Hz, growth rate ${rate(mode.growth_rate_1_per_s)} per second, ` +
      `${mode.stability}. Kinetic energy: ${shares.join(", ")}. ${view} ` +
      `Slowed ${Math.round(mode.slowed)} times: a period takes ${data.period_s} s. ${mode.size}`;
    draw();
  };
  const step = (time) => {
    if (!running) return;
    if (last !== null) phase = (phase + (360 * (time - last)) / 1000 / data.period_s) % 360;
    last = time;
    draw();
    window.requestAnimationFrame(step);
  };
  const run = (wanted) => {
    if (wanted === running) return;
    running = wanted;
    last = null;
    play.textContent = running ? "Pause" : "Play";
    if (running) window.requestAnimationFrame(step);
  };
  play.disabled = false;
  play.addEventListener("click", () => run(!running));
  slider.addEventListener("input", () => { run(false); phase = Number(slider.value); draw(); });
  for (const choice of document.querySelectorAll('input[name="mode"]')) {
    choice.addEventListener("change", () => choose(Number(choice.value)));
  }
  choose(data.first);
  still.addEventListener("change", () => { if (still.matches) run(false); });
  run(!still.matches);
})();

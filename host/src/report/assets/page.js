// Draws the line plots of a page: decodes the series (plot.rs writes them), an overview and, where wanted, a zoom
// window beside it; plots of a group share cursor and zoom. Colours come from the style sheet.
(() => {
  "use strict";
  const root = document.documentElement;
  const figures = [...document.querySelectorAll("figure.plot")];
  let drawn = [];

  const words = (base64, Type) => {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return new Type(bytes.buffer);
  };

  const decode = (plot) => {
    const x = Array.from(words(plot.x, Float32Array), (v) => plot.x0 + v);
    const columns = plot.series.map((s) =>
      Array.from(words(s.data, Int16Array), (c) => (c === -32768 ? null : s.low + s.step * (c + 32767))));
    return [x, ...columns];
  };

  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  const series = (s) => {
    const pale = s.stroke === "measured";
    return {
      label: s.label,
      stroke: colour(s.colour) + (pale ? "66" : ""),
      width: pale ? 4 : 1.4,
      paths: s.stroke === "held" ? uPlot.paths.stepped({ align: 1 }) : undefined,
      points: { show: false },
      value: (_, v) => (v == null ? "–" : v.toPrecision(4)),
    };
  };

  const axis = (label, size, space) => ({
    label, size, space, labelSize: 22, labelGap: 2, gap: 4,
    font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif",
    stroke: colour("--ink-soft"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--grid"), width: 1 },
  });

  // Names ranges of the abscissa behind the curves, draws the line of zero, and marks what the zoom window shows.
  const bands = (plot) => (u) => {
    const { ctx, bbox } = u;
    const px = (v) => Math.min(Math.max(u.valToPos(v, "x", true), bbox.left), bbox.left + bbox.width);
    ctx.save();
    plot.bands.forEach((band, i) => {
      const [a, b] = [px(band.from), px(band.to)];
      if (b <= a) return;
      ctx.fillStyle = colour(i % 2 ? "--band-b" : "--band-a");
      ctx.fillRect(a, bbox.top, b - a, bbox.height);
      ctx.fillStyle = colour("--ink-soft");
      ctx.font = `${12 * uPlot.pxRatio}px system-ui, sans-serif`;
      ctx.textAlign = "center";
      ctx.textBaseline = "bottom";
      if (ctx.measureText(band.label).width < b - a) ctx.fillText(band.label, (a + b) / 2, bbox.top - 4 * uPlot.pxRatio);
    });
    const { min, max } = u.scales.y;
    if (plot.zero && min <= 0 && max >= 0) {
      const y = u.valToPos(0, "y", true);
      ctx.fillStyle = colour("--ink-soft");
      ctx.fillRect(bbox.left, y - 0.5 * uPlot.pxRatio, bbox.width, uPlot.pxRatio);
    }
    if (plot.zoom) {
      const [a, b] = plot.zoom.map(px);
      ctx.fillStyle = colour("--zoom");
      ctx.fillRect(a, bbox.top, Math.max(b - a, 2 * uPlot.pxRatio), bbox.height);
    }
    ctx.restore();
  };

  let following = false;
  const follow = (group) => (u, key) => {
    if (key !== "x" || following || !group) return;
    following = true;
    const { min, max } = u.scales.x;
    for (const other of drawn) {
      const s = other.u.scales.x;
      if (other.group === group && other.u !== u && (s.min !== min || s.max !== max)) other.u.setScale("x", { min, max });
    }
    following = false;
  };

  const draw = (figure) => {
    const plot = JSON.parse(figure.querySelector("script").textContent);
    const data = decode(plot);
    const make = (holder, columns, overview) => {
      const u = new uPlot({
        width: Math.max(holder.clientWidth, 240),
        height: plot.height,
        pxAlign: 0,
        // Room for the bands' names above the curves, on both drawings so that they stay level.
        padding: [plot.bands.length ? 24 : 8, 12, 0, 0],
        scales: { x: { time: false } },
        axes: [axis(plot.x_label, 26, 60), axis(plot.y_label, 54, 26)],
        series: [{ label: plot.x_label, value: (_, v) => (v == null ? "–" : v.toFixed(3)) }, ...plot.series.map(series)],
        cursor: {
          drag: { x: true, y: false },
          points: { size: 6 },
          sync: plot.group ? { key: plot.group + (overview ? "" : "/zoom") } : undefined,
        },
        // Below both drawings, where it has the whole width.
        legend: { show: overview, mount: (_, legend) => figure.querySelector(".legend").replaceChildren(legend) },
        hooks: overview ? { drawClear: [bands(plot)], setScale: [follow(plot.group)] } : {},
      }, columns, holder);
      drawn.push({ u, holder, group: overview ? plot.group : null });
    };
    make(figure.querySelector(".overview"), data, true);
    if (plot.zoom) {
      const from = data[0].findIndex((v) => v >= plot.zoom[0]);
      const to = data[0].findLastIndex((v) => v <= plot.zoom[1]);
      make(figure.querySelector(".zoom"), data.map((c) => c.slice(from, to + 1)), false);
    }
  };

  const drawAll = () => {
    drawn.forEach(({ u }) => u.destroy());
    drawn = [];
    figures.forEach(draw);
  };

  drawAll();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  // On paper: light colours and the width of the sheet, whatever the screen shows.
  addEventListener("beforeprint", () => { root.classList.add("paper"); drawAll(); });
  addEventListener("afterprint", () => { root.classList.remove("paper"); drawAll(); });
  let width = root.clientWidth;
  addEventListener("resize", () => {
    if (root.clientWidth === width || root.classList.contains("paper")) return;
    width = root.clientWidth;
    drawn.forEach(({ u, holder }) => u.setSize({ width: Math.max(holder.clientWidth, 240), height: u.height }));
  });
})();

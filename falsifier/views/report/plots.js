"use strict";
// Draws a group of plots when it comes near the view. Without scripts, the tables beside them stay open.
(() => {
  const [blue, green, red, grey, light] = ["#1f5fa8", "#2f7d4f", "#b3261e", "#57606a", "#8c98a4"];
  const [dashed, dotted] = [[6, 4], [2, 4]];
  // The page turns these colours round in dark mode.
  const LOOKS = {
    zero: { line_color: grey, line_dash: dashed },
    limit: { line_color: grey, line_dash: dotted },
    bound: { line_color: red, line_dash: dashed, line_width: 1.5 },
    best: { line_color: blue, line_width: 1.5 },
    output: { line_color: blue, line_width: 1.5 },
    input: { line_color: green, line_width: 1.5 },
    dots: { color: light, alpha: 0.6, size: 5 },
    point: { color: green, size: 6 },
    critical: { color: red, size: 9 },
    decided: { line_color: red, fill_color: null, size: 9 },
    ...Object.fromEntries(["#1f5fa8", "#b35900", "#2f7d4f", "#7b3fa0", "#a3174f", "#5f6a00"].map(
      (line_color, i) => [`s${i}`, { line_color, line_width: 2 }])),
  };
  const AXES = { time: "time [s]", simulation: "simulation", simulations: "simulations" };

  function hover(plot, renderer, axis, { read, seed }, mode) {
    const unit = axis === "time" ? " s" : "";
    const tooltips = [[axis, `@x{%.7g}${unit}`], [read, "@y{%.7g}"]];
    if (seed !== undefined) tooltips.push(["seed", String(seed)]);
    const formatters = { "@x": "printf", "@y": "printf" };
    plot.add_tools(new Bokeh.HoverTool({ renderers: [renderer], tooltips, formatters, mode, visible: false }));
  }

  function figure(shown, { axis, mark }, x_range, height, last, reading) {
    const [start, end] = shown.range;
    const plot = Bokeh.Plotting.figure({
      x_range,
      y_range: new Bokeh.Range1d({ start, end }),
      height,
      sizing_mode: "stretch_width",
      tools: "box_zoom,pan,xwheel_zoom,reset,save",
      active_drag: "box_zoom",
      active_scroll: null,
      min_border_left: 72,
      background_fill_color: null,
      border_fill_color: null,
    });
    plot.toolbar.logo = null;
    plot.toolbar.group = false;
    plot.xgrid.grid_line_color = plot.ygrid.grid_line_color = grey;
    plot.xgrid.grid_line_alpha = plot.ygrid.grid_line_alpha = 0.2;
    plot.xaxis.axis_label = last ? AXES[axis] : null;
    plot.yaxis.ticker = new Bokeh.BasicTicker({ desired_num_ticks: 5 });
    plot.yaxis.minor_tick_line_color = null;
    if (axis !== "time") plot.xaxis.ticker = new Bokeh.BasicTicker({ min_interval: 1 });
    for (const [spans, fill_color, fill_alpha] of [[shown.windows, grey, 0.1], [shown.broken, red, 0.15]]) {
      for (const [left, right] of spans ?? []) {
        plot.add_layout(new Bokeh.BoxAnnotation({ left, right, fill_color, fill_alpha, line_color: null }));
      }
    }
    for (const { y, style } of shown.levels ?? []) {
      plot.add_layout(new Bokeh.Span({ location: y, dimension: "width", ...LOOKS[style] }));
    }
    for (const curve of shown.lines) {
      const source = new Bokeh.ColumnDataSource({ data: { x: curve.x, y: curve.y } });
      const look = { source, ...LOOKS[curve.style] };
      const line = curve.steps
        ? plot.step({ field: "x" }, { field: "y" }, "after", look)
        : plot.line({ field: "x" }, { field: "y" }, look);
      if (curve.read) hover(plot, line, axis, curve, "vline");
    }
    for (const curve of shown.dots ?? []) {
      const source = new Bokeh.ColumnDataSource({ data: { x: curve.x, y: curve.y } });
      const dots = plot.scatter({ field: "x" }, { field: "y" }, { source, ...LOOKS[curve.style] });
      if (curve.read) hover(plot, dots, axis, curve, "mouse");
    }
    if (mark !== null) {
      plot.add_layout(new Bokeh.Span({ location: mark, dimension: "height", line_color: red, line_dash: dotted }));
    }
    plot.add_tools(new Bokeh.CrosshairTool({ overlay: reading, visible: false }));
    return plot;
  }

  function draw(group) {
    const shown = JSON.parse(group.querySelector("script").textContent);
    const places = [...group.querySelectorAll(".plot")];
    const x_range = new Bokeh.Range1d({ start: shown.start, end: shown.end });
    const reading = new Bokeh.Span({ dimension: "height", line_color: grey, line_dash: dotted });
    const document_ = new Bokeh.Document();
    shown.plots.forEach((plot, i) => {
      const last = i === shown.plots.length - 1;
      document_.add_root(figure(plot, shown, x_range, places[i].clientHeight, last, reading));
    });
    Bokeh.embed.add_document_standalone(document_, group, places);
  }

  const observer = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (isIntersecting) {
        observer.unobserve(target);
        draw(target);
      }
    }
  }, { rootMargin: "2000px" });

  document.documentElement.classList.add("scripted");
  for (const group of document.querySelectorAll(".plots")) {
    group.querySelector("details.numbers").open = false;
    observer.observe(group);
  }
})();

"use strict";
(() => {
  const COLOURS = @colours@;
  // Widths, px: of a window with one column, of text, of a line of text.
  const NARROW = 700, TEXT = 12, SMALL = 11, LINE = 15;
  const FONT = "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  const root = document.documentElement;
  const button = document.getElementById("theme");
  const figures = [...document.querySelectorAll("figure")].map((element) => ({
    data: JSON.parse(element.querySelector("script").textContent),
    plot: element.querySelector(".plot"),
    legend: element.querySelector(".legend"),
    hidden: new Set(),
    zoom: new Map(),
  }));

  // ---- Elements and words

  const svg = (name, attributes, ...children) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) if (value !== undefined) element.setAttribute(key, value);
    element.append(...children);
    return element;
  };
  const pen = document.createElement("canvas").getContext("2d");
  const length = (text, size, weight) => {
    pen.font = `${weight || ""} ${size}px ${FONT}`;
    return pen.measureText(text).width;
  };
  const words = (text, x, y, attributes) => svg("text", { x, y, "font-size": TEXT, ...attributes }, text);
  const halo = (colours) => ({ stroke: colours.paper, "stroke-width": 4, "paint-order": "stroke", "stroke-linejoin": "round" });
  const titled = (axis) => (axis.unit ? `${axis.label} [${axis.unit}]` : axis.label);
  const wrapped = (text, room, size, weight) => {
    const lines = [];
    for (const word of text.split(" ")) {
      const longer = lines.length ? `${lines[lines.length - 1]} ${word}` : word;
      if (lines.length && length(longer, size, weight) < room) lines[lines.length - 1] = longer;
      else lines.push(word);
    }
    return text ? lines : [];
  };
  const pick = (list, number) => list[number % list.length];

  // ---- Axes

  const SUPERSCRIPT = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  const raised = (number) => String(number).replace("-", "⁻").replace(/\d/g, (digit) => SUPERSCRIPT[digit]);
  // A number between neighbours that are `step` away.
  function spelled(value, step) {
    if (value === 0) return "0";
    const size = Math.floor(Math.log10(Math.abs(value)) + 1e-12);
    const digits = Math.max(0, size - Math.floor(Math.log10(step) + 1e-9));
    if (size < -3 || size > 4) {
      const mantissa = (value / 10 ** size).toFixed(Math.min(digits, 12));
      return mantissa === "1" ? `10${raised(size)}` : `${mantissa.replace("-", "−")}·10${raised(size)}`;
    }
    return value.toFixed(Math.min(Math.max(0, digits - size), 12)).replace("-", "−");
  }
  function ticks(axis, [low, high], count) {
    if (axis.places) {
      const places = [];
      for (let at = Math.ceil(low); at <= high; at++) places.push([at, ""]);
      return places;
    }
    const decades = axis.logarithmic ? Math.log10(high / low) : 0;
    if (decades >= 1) {
      const step = Math.max(1, Math.ceil(decades / count));
      const marks = decades < 2 && count >= 3 ? [1, 2, 5] : [1];
      const all = [];
      for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high) + 1e-9; power++) {
        for (const mark of marks) {
          const value = Number(`${mark}e${power}`);
          if (value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9) && power % step === 0) all.push([value, spelled(value, value)]);
        }
      }
      return all;
    }
    const rough = (high - low) / Math.max(count, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5].find((one) => one * power >= rough) || 10);
    const all = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) {
      const value = Number((i * step).toPrecision(12));
      all.push([value, spelled(value, step)]);
    }
    return all;
  }
  function scale(axis, range, from, to, count) {
    const of = axis.logarithmic ? Math.log10 : (value) => value;
    const [low, high] = range.map(of);
    const at = (value) => from + ((of(value) - low) / (high - low)) * (to - from);
    const value = (pixel) => {
      const inner = low + ((pixel - from) / (to - from)) * (high - low);
      return axis.logarithmic ? 10 ** inner : inner;
    };
    const holds = (one) => one >= range[0] && one <= range[1];
    return { axis, range, from, to, at, value, holds, ticks: ticks(axis, range, count) };
  }

  // ---- Panels

  // The shown ranges of a panel; equal scales have the longer one fit.
  function ranges(figure, panel, i, across, high) {
    const { x, y } = { x: panel.x.range, y: panel.y.range, ...figure.zoom.get(i) };
    if (!panel.equal) return [x, y];
    const unit = Math.max((x[1] - x[0]) / across, (y[1] - y[0]) / high);
    const fit = ([low, end], pixels) => [(low + end - unit * pixels) / 2, (low + end + unit * pixels) / 2];
    return [fit(x, across), fit(y, high)];
  }

  // The path of a line: points that share a column of pixels become its first, lowest, highest and last.
  function path(series, X, Y) {
    let text = "", open = false, column = null, group = [];
    const flush = () => {
      if (group.length > 4) {
        const ys = group.map((point) => point[1]);
        const low = group[ys.indexOf(Math.min(...ys))], top = group[ys.indexOf(Math.max(...ys))];
        group = [group[0], ...(group.indexOf(low) < group.indexOf(top) ? [low, top] : [top, low]), group[group.length - 1]];
      }
      for (const [x, y] of group) {
        text += `${open ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
        open = true;
      }
      group = [];
    };
    for (let i = 0; i < series.x.length; i++) {
      const [x, y] = [series.x[i], series.y[i]];
      if (x === null || y === null) {
        flush();
        open = false;
        column = null;
        continue;
      }
      // Far outside, coordinates would grow beyond what pictures hold.
      const bounded = (pixel) => Math.max(-1e5, Math.min(1e5, pixel));
      const point = [bounded(X.at(x)), bounded(Y.at(y))];
      if (Math.round(point[0]) !== column) flush();
      column = Math.round(point[0]);
      group.push(point);
    }
    flush();
    return text;
  }

  function drawn(series, X, Y, colours) {
    const colour = pick(colours.series, series.colour);
    const many = series.x.length > 300;
    const group = svg("g", { class: "series", fill: "none", stroke: colour, "stroke-linejoin": "round", "stroke-linecap": "round" });
    const line = (width, dashes) => group.append(svg("path", { d: path(series, X, Y), "stroke-width": width, "stroke-dasharray": dashes }));
    const points = (radius, filled) => {
      // Points on the same pixel are one.
      const seen = new Set();
      let text = "";
      series.x.forEach((x, i) => {
        if (x === null || series.y[i] === null || !X.holds(x) || !Y.holds(series.y[i])) return;
        const at = `${X.at(x).toFixed(many ? 0 : 1)} ${Y.at(series.y[i]).toFixed(many ? 0 : 1)}`;
        if (seen.has(at)) return;
        seen.add(at);
        text += `M${at}m${-radius} 0a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`;
      });
      group.append(svg("path", { d: text, ...(filled ? { fill: colour, stroke: "none" } : { "stroke-width": 1.6 }) }));
    };
    const styles = {
      hairline: () => line(many ? 0.7 : 0.9),
      dashed: () => line(1.6, "6 4"),
      points: () => points(many ? 1.5 : 3, true),
      joined: () => { line(1.6); points(many ? 1.5 : 3, true); },
      marks: () => points(many ? 2.5 : 4, false),
      stems: () => {
        const foot = Y.at(Y.axis.logarithmic ? Y.range[0] : Math.max(Y.range[0], Math.min(Y.range[1], 0))).toFixed(1);
        const stem = (x, y) => (x === null || y === null ? "" : `M${X.at(x).toFixed(1)} ${foot}V${Y.at(y).toFixed(1)}`);
        group.append(svg("path", { d: series.x.map((x, i) => stem(x, series.y[i])).join(""), "stroke-width": 1.5 }));
        points(many ? 0.5 : 2.5, true);
      },
    };
    (styles[series.style] || (() => line(1.6)))();
    return group;
  }

  // Middles of the names above a panel, px: moved no farther than they must to stand apart.
  function sideBySide(guides, X) {
    const named = guides.filter((guide) => guide.x !== undefined && X.holds(guide.x))
      .map((guide) => ({ guide, at: X.at(guide.x) - X.from, room: length(guide.name, SMALL) + 8 }));
    named.sort((one, other) => one.at - other.at);
    let free = 0, end = X.to - X.from;
    for (const name of named) {
      name.left = Math.max(name.at - name.room / 2, free);
      free = name.left + name.room;
    }
    for (const name of [...named].reverse()) end = name.left = Math.min(name.left, end - name.room);
    return named.filter((name) => name.left >= 0).map((name) => [name.guide, X.from + name.left + name.room / 2]);
  }

  // Lines across a panel, and words in it. Words that would meet others are left out; those of upright lines first look for room below.
  function guides(panel, X, Y, colours) {
    const lines = [], texts = [], taken = [];
    const free = (room) => taken.every((other) => room.right <= other.left || other.right <= room.left || room.low <= other.top || other.low <= room.top);
    const faint = { ...halo(colours), fill: colours.muted, "font-size": SMALL };
    const place = (text, x, y, anchor, attributes) => {
      const size = length(text, SMALL) + 6;
      let left = anchor === "start" ? x : anchor === "end" ? x - size : x - size / 2;
      left = Math.max(X.from, Math.min(left, X.to - size));
      const room = { left, right: left + size, top: y - SMALL - 2, low: y + 4 };
      if (!free(room)) return;
      taken.push(room);
      texts.push(words(text, left + 3, y, { ...attributes }));
    };
    for (const note of panel.notes) {
      const [x, y] = [X.at(note.at[0]), Y.at(note.at[1])];
      if (!X.holds(note.at[0]) || !Y.holds(note.at[1])) continue;
      const left = x - X.from > 0.6 * (X.to - X.from);
      place(note.text, x + (left ? -5 : 5), Math.max(Y.to + 12, y - (panel.y.places ? 5 : 3)), left ? "end" : "start",
        { ...halo(colours), fill: colours.ink, "font-size": SMALL });
    }
    const line = (x1, y1, x2, y2, dashes) => lines.push(svg("line",
      { class: "shade", x1, y1, x2, y2, stroke: colours.muted, "stroke-width": dashes ? 1 : 0.8, "stroke-dasharray": dashes }));
    for (const guide of panel.guides.filter((guide) => guide.x === undefined)) {
      if (guide.y !== undefined) {
        const y = Y.at(guide.y);
        line(X.from, y, X.to, y, "4 3");
        if (Y.holds(guide.y)) place(guide.name, X.to - 2, y - 4 > Y.to + 10 ? y - 4 : y + 13, "end", faint);
      } else {
        const [[x1, y1], [x2, y2]] = [guide.from, guide.to].map(([x, y]) => [X.at(x), Y.at(y)]);
        line(x1, y1, x2, y2);
        if (X.holds(guide.to[0]) && Y.holds(guide.to[1])) place(guide.name, x2, y2 < Y.to + 16 ? y2 + 13 : y2 - 4, x2 > X.to - 20 ? "end" : "middle", faint);
      }
    }
    const upright = panel.guides.filter((guide) => guide.x !== undefined);
    for (const guide of upright) {
      const x = X.at(guide.x);
      line(x, Y.from, x, Y.to, "4 3");
      if (panel.namesAbove || !X.holds(guide.x)) continue;
      const size = length(guide.name, SMALL) + 8;
      const low = Y.from - size - 2;
      for (let top = Y.to + 3; top <= low; top += 6) {
        const room = { left: x - 8, right: x + 8, top, low: top + size };
        if (!free(room)) continue;
        taken.push(room);
        texts.push(words(guide.name, 0, 0, { ...faint, "text-anchor": "end", transform: `translate(${x + 4} ${top + 4}) rotate(-90)` }));
        break;
      }
    }
    if (panel.namesAbove) {
      sideBySide(upright, X).forEach(([guide, x]) => texts.push(words(guide.name, x, Y.to - 4, { ...faint, "text-anchor": "middle" })));
    }
    return { lines, texts };
  }

  // The classes of cells as an image, one pixel a cell.
  function image(raster, X, Y) {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [raster.columns, raster.points.length / raster.columns];
    const pixels = new ImageData(canvas.width, canvas.height);
    for (let i = 0; i < raster.points.length; i++) pixels.data.set([...raster.classes[raster.points.charCodeAt(i) - 48][1], 255], 4 * i);
    canvas.getContext("2d").putImageData(pixels, 0, 0);
    const [left, right] = raster.x.map(X.at), [low, top] = raster.y.map(Y.at);
    return svg("image", { x: left, y: top, width: right - left, height: low - top, href: canvas.toDataURL(), preserveAspectRatio: "none", style: "image-rendering:pixelated" });
  }

  // One panel in a room of `room` by `height`, its frame from `left` to `room - right` and from `top` to `height - bottom`.
  function sheet(figure, panel, i, frame, colours) {
    const { room, height, left, right, top, bottom, titles } = frame;
    const [across, high] = [room - left - right, height - top - bottom];
    const [x, y] = ranges(figure, panel, i, across, high);
    const X = scale(panel.x, x, left, room - right, Math.max(2, Math.floor(across / 56)));
    const Y = scale(panel.y, y, height - bottom, top, Math.max(2, Math.floor(high / 36)));
    const picture = svg("svg", { class: "panel", width: room, height, viewBox: `0 0 ${room} ${height}`, tabindex: 0, role: "img",
      "aria-label": panel.title || titled(panel.y), "data-x": JSON.stringify(x), "data-y": JSON.stringify(y), fill: colours.ink, "font-family": FONT });
    const clip = `${figure.plot.parentNode.id}-${i}`;
    picture.append(svg("clipPath", { id: clip }, svg("rect", { x: left, y: top, width: across, height: high })));
    const inside = svg("g", { "clip-path": `url(#${clip})` });
    const box = (x0, x1, y0, y1, fill, opacity) => svg("rect", { class: "shade", x: Math.min(X.at(x0), X.at(x1)), y: Math.min(y0, y1),
      width: Math.abs(X.at(x1) - X.at(x0)), height: Math.abs(y1 - y0), fill, opacity });
    if (panel.raster) inside.append(image(panel.raster, X, Y));
    for (const tile of panel.tiles) {
      if (!figure.hidden.has("tile " + tile.name)) {
        inside.append(box(...tile.x, ...tile.y.map(Y.at), pick(colours.tiles, tile.colour), colours.tileOpacity));
      }
    }
    for (const band of panel.bands) {
      if (!figure.hidden.has("band " + band.name)) inside.append(box(...band.x, Y.from, Y.to, pick(colours.bands, band.colour), colours.bandOpacity));
    }
    const grid = svg("g", { stroke: colours.grid });
    X.ticks.forEach(([value]) => grid.append(svg("line", { x1: X.at(value), x2: X.at(value), y1: Y.from, y2: Y.to })));
    Y.ticks.forEach(([value]) => grid.append(svg("line", { x1: X.from, x2: X.to, y1: Y.at(value), y2: Y.at(value) })));
    // An image is light in both themes.
    const light = COLOURS.light;
    const { lines, texts } = guides(panel, X, Y, panel.raster ? { ...light, muted: light.ink } : colours);
    const visible = panel.series.filter((series) => !figure.hidden.has("series " + series.name));
    inside.append(...(panel.raster ? [] : [grid]), ...lines, ...visible.map((series) => drawn(series, X, Y, colours)));
    picture.append(inside, svg("path", { d: `M${left} ${top}V${height - bottom}H${room - right}`, fill: "none", stroke: colours.muted }));
    let free = -Infinity;
    for (const [value, text] of X.ticks) {
      // Numbers do not meet, nor leave the picture.
      const half = length(text, SMALL) / 2;
      const at = Math.max(half, Math.min(X.at(value), room - half));
      if (at - half < free + 4) continue;
      free = at + half;
      picture.append(words(text, at, height - bottom + 15, { class: "tick-x", "font-size": SMALL, "text-anchor": "middle" }));
    }
    Y.ticks.forEach(([value, text]) => picture.append(words(text, left - 5, Math.min(Y.at(value) + 4, height - bottom + 2), { class: "tick-y", "font-size": SMALL, "text-anchor": "end" })));
    titles.x.forEach((text, line) => picture.append(words(text, left + across / 2, height - bottom + 32 + line * LINE, { "text-anchor": "middle" })));
    titles.y.forEach((text, line) => picture.append(words(text, 0, 0, { "text-anchor": "middle", transform: `translate(${12 + line * LINE} ${top + high / 2}) rotate(-90)` })));
    titles.top.forEach((text, line) => picture.append(words(text, left, 13 + line * LINE, { "font-weight": "bold" })));
    const over = svg("rect", { class: "over", x: left, y: top, width: across, height: high, fill: "transparent" });
    picture.append(...texts, over);
    attend(figure, panel, i, picture, over, { X, Y, visible, colours });
    return picture;
  }

  // ---- Pointing and zooming

  const digits = (value) => Number(value.toPrecision(7)).toString().replace("-", "−").replace(/e\+?(.*)/, (_, power) => `·10${raised(power.replace("−", "-"))}`);

  function attend(figure, panel, i, picture, over, { X, Y, visible, colours }) {
    const hover = svg("g", { class: "hover", "pointer-events": "none" });
    picture.append(hover);
    const at = (event) => {
      const room = picture.getBoundingClientRect();
      return [Math.max(X.from, Math.min(event.clientX - room.left, X.to)), Math.max(Y.to, Math.min(event.clientY - room.top, Y.from))];
    };
    const point = (event) => {
      const [px, py] = at(event);
      let best = { distance: 60 };
      for (const series of visible) {
        series.x.forEach((x, k) => {
          if (x === null || series.y[k] === null || !X.holds(x) || !Y.holds(series.y[k])) return;
          const distance = Math.hypot(X.at(x) - px, Y.at(series.y[k]) - py);
          if (distance < best.distance) best = { distance, x, y: series.y[k], series };
        });
      }
      hover.replaceChildren();
      const { raster } = panel;
      if (!best.series && raster) {
        const [x, y] = [X.value(px), Y.value(py)];
        const [column, row] = [(x - raster.x[0]) / (raster.x[1] - raster.x[0]) * raster.columns, (raster.y[1] - y) / (raster.y[1] - raster.y[0]) * raster.points.length / raster.columns];
        const cell = raster.points.charCodeAt(Math.floor(row) * raster.columns + Math.floor(column)) - 48;
        best = { x, y, series: { name: (raster.classes[cell] || [""])[0] } };
      }
      if (!best.series) return;
      const value = (axis, number) => `${axis.label} ${digits(number)} ${axis.unit}`.trim();
      const lines = [best.series.name, value(panel.x, best.x), value(panel.y, best.y)].filter((line) => line);
      const [wide, tall] = [Math.max(...lines.map((line) => length(line, SMALL))) + 12, lines.length * LINE + 6];
      const [cx, cy] = [X.at(best.x), Y.at(best.y)];
      const left = Math.max(2, Math.min(cx + 10 + wide > X.to ? cx - 10 - wide : cx + 10, X.to - wide));
      const top = Math.max(2, Math.min(cy - tall / 2, Y.from - tall));
      hover.append(svg("circle", { cx, cy, r: 5, fill: "none", stroke: colours.ink, "stroke-width": 1.5 }),
        svg("rect", { x: left, y: top, width: wide, height: tall, rx: 3, fill: colours.paper, stroke: colours.muted }),
        ...lines.map((line, k) => words(line, left + 6, top + 14 + k * LINE, { "font-size": SMALL })));
    };
    const zoom = (x, y) => {
      const same = (other) => other.x.label === panel.x.label && String(other.x.range) === String(panel.x.range);
      figure.data.panels.forEach((other, k) => {
        if (k === i || (x && same(other) && !panel.equal)) figure.zoom.set(k, { ...figure.zoom.get(k), ...(x && { x }), ...(k === i && y && { y }) });
      });
      draw(figure);
      figure.plot.querySelectorAll(".panel")[i].focus({ preventScroll: true });
    };
    let from = null;
    const frame = (to) => {
      const [wide, tall] = [0, 1].map((k) => Math.abs(to[k] - from[k]));
      // A stroke along one axis zooms that one alone.
      return panel.equal ? [true, true] : [wide > 8 && wide > tall / 4, tall > 8 && tall > wide / 4];
    };
    over.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      event.preventDefault();
      picture.focus({ preventScroll: true });
      from = at(event);
      const rect = svg("rect", { fill: colours.muted, opacity: 0.25 });
      const move = (event) => {
        const to = at(event);
        const [x, y] = frame(to);
        const [low, high] = [[0, x, X], [1, y, Y]].map(([k, on, axis]) => (on ? [from[k], to[k]] : [axis.from, axis.to])).map((ends) => ends.sort((a, b) => a - b));
        for (const [name, value] of [["x", low[0]], ["width", low[1] - low[0]], ["y", high[0]], ["height", high[1] - high[0]]]) rect.setAttribute(name, value);
        hover.replaceChildren(rect);
      };
      const end = (event) => {
        removeEventListener("pointermove", move);
        removeEventListener("pointerup", end);
        const to = at(event);
        const [x, y] = frame(to);
        const start = from;
        from = null;
        const range = (k, axis) => [axis.value(start[k]), axis.value(to[k])].sort((a, b) => a - b);
        hover.replaceChildren();
        if (Math.hypot(to[0] - start[0], to[1] - start[1]) > 8) zoom(x && range(0, X), y && range(1, Y));
      };
      addEventListener("pointermove", move);
      addEventListener("pointerup", end);
    });
    over.addEventListener("pointermove", (event) => from || point(event));
    over.addEventListener("click", point);
    over.addEventListener("pointerleave", () => from || hover.replaceChildren());
    const reset = () => { figure.zoom.clear(); draw(figure); };
    over.addEventListener("dblclick", reset);
    picture.addEventListener("keydown", (event) => {
      const span = (axis, low, high) => [low, high].map((part) => axis.value(axis.from + part * (axis.to - axis.from)));
      const acts = {
        ArrowLeft: () => zoom(span(X, -0.2, 0.8)), ArrowRight: () => zoom(span(X, 0.2, 1.2)),
        ArrowUp: () => zoom(null, span(Y, 0.2, 1.2)), ArrowDown: () => zoom(null, span(Y, -0.2, 0.8)),
        "+": () => zoom(span(X, 0.15, 0.85)), "-": () => zoom(span(X, -0.2, 1.2)), 0: reset, Escape: reset,
      };
      if (!acts[event.key]) return;
      event.preventDefault();
      acts[event.key]();
    });
  }

  // ---- Figures

  function frames(figure, width) {
    const { panels } = figure.data;
    const columns = width < NARROW ? 1 : figure.data.columns;
    const rows = Math.ceil(panels.length / columns);
    const gap = 14;
    const room = Math.floor((width - gap * (columns - 1)) / columns);
    const high = figure.data.height * (panels.some((panel) => panel.equal) ? Math.min(room - 80, 560)
      : columns === 1 ? (rows === 1 ? Math.min(440, Math.max(260, room * 0.55)) : 210) : Math.max(190, room * 0.52));
    const titles = panels.map((panel) => ({
      x: wrapped(titled(panel.x), room - 80, TEXT), y: wrapped(titled(panel.y), high, TEXT), top: wrapped(panel.title, room - 70, TEXT, "bold"),
    }));
    const bottom = 24 + LINE * Math.max(1, ...titles.map((title) => title.x.length));
    const top = 10 + LINE * Math.max(0, ...titles.map((title) => title.top.length)) + (panels.some((panel) => panel.namesAbove) ? 16 : 0);
    const lefts = panels.map((panel, i) => {
      const [, y] = ranges(figure, panel, i, room - 80, high);
      const longest = Math.max(0, ...ticks(panel.y, y, Math.max(2, Math.floor(high / 36))).map(([, text]) => length(text, SMALL)));
      return longest + 14 + LINE * titles[i].y.length;
    });
    return panels.map((panel, i) => ({
      room, height: high + top + bottom, top, bottom, right: 14, titles: titles[i],
      left: Math.max(...lefts.filter((_, other) => other % columns === i % columns)), columns,
    }));
  }

  function sample(look, colours) {
    const colour = pick({ band: colours.bands, tile: colours.tiles }[look.style] || colours.series, look.colour);
    const line = (width, dash) => `<line x1="1" y1="6" x2="21" y2="6" stroke="${colour}" stroke-width="${width}" stroke-dasharray="${dash || ""}"/>`;
    const dot = `<circle cx="11" cy="6" r="2.6" fill="${colour}"/>`;
    const shapes = {
      hairline: line(1), dashed: line(2, "5 3"), points: dot, joined: line(2) + dot,
      marks: `<circle cx="11" cy="6" r="3.6" fill="none" stroke="${colour}" stroke-width="1.6"/>`,
      stems: `<line x1="11" y1="12" x2="11" y2="3" stroke="${colour}" stroke-width="1.8"/><circle cx="11" cy="3" r="2" fill="${colour}"/>`,
      band: `<rect width="22" height="12" fill="${colour}" opacity="${1.8 * colours.bandOpacity}"/>`,
      tile: `<rect width="22" height="12" fill="${colour}" opacity="${colours.tileOpacity}"/>`,
    };
    return `<svg width="22" height="12" aria-hidden="true">${shapes[look.style] || line(2)}</svg>`;
  }

  function legend(figure, colours) {
    const toggles = figure.data.legend.map((entry) => {
      const key = ({ band: "band ", tile: "tile " }[entry.looks[0].style] || "series ") + entry.name;
      const toggle = document.createElement("button");
      toggle.type = "button";
      toggle.innerHTML = entry.looks.map((look) => sample(look, colours)).join("");
      toggle.append(entry.name);
      toggle.setAttribute("aria-pressed", String(!figure.hidden.has(key)));
      toggle.addEventListener("click", () => {
        if (!figure.hidden.delete(key)) figure.hidden.add(key);
        draw(figure);
      });
      return toggle;
    });
    const classes = new Map(figure.data.panels.flatMap((panel) => (panel.raster ? panel.raster.classes : [])).map(([name, colour]) => [name, colour]));
    classes.forEach((colour, name) => {
      const entry = document.createElement("span");
      entry.innerHTML = `<svg width="22" height="12" aria-hidden="true"><rect width="22" height="12" fill="rgb(${colour})" stroke="${colours.muted}"/></svg>`;
      entry.append(name);
      toggles.push(entry);
    });
    const reset = document.createElement("button");
    reset.type = "button";
    reset.className = "reset";
    reset.textContent = "Whole range";
    reset.hidden = figure.zoom.size === 0;
    reset.addEventListener("click", () => { figure.zoom.clear(); draw(figure); });
    figure.legend.replaceChildren(...toggles, reset);
  }

  // ---- Animations

  // Outline of a gear about its centre; of a ring with its rim.
  function outline(gear) {
    const pitch = (2 * Math.PI) / gear.teeth, addendum = (2 * gear.radius) / gear.teeth;
    const inward = gear.ring ? -1 : 1;
    const [root, tip] = [gear.radius - 1.25 * inward * addendum, gear.radius + inward * addendum];
    const at = (radius, angle) => `${(radius * Math.cos(angle)).toPrecision(5)} ${(radius * Math.sin(angle)).toPrecision(5)}`;
    let path = "";
    for (let k = 0; k < gear.teeth; k++) {
      const middle = gear.angle + (k + (gear.ring ? 0.5 : 0)) * pitch;
      [[root, -0.32], [tip, -0.16], [tip, 0.16], [root, 0.32]].forEach(([radius, part]) => {
        path += `${path ? "L" : "M"}${at(radius, middle + part * pitch)}`;
      });
    }
    const circle = (radius) => `M${-radius} 0a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0Z`;
    return `${path}Z${gear.ring ? circle(root + 1.5 * addendum) : circle(0.12 * gear.radius)}`;
  }

  function animate(figure) {
    const { data, plot } = figure;
    const frames = data.contacts[0].deflection.length;
    let frame = figure.frame || 0, playing = false, last = 0, movers = [];
    const control = figure.legend;
    const play = document.createElement("button"), slider = document.createElement("input"), time = document.createElement("output");
    play.type = "button";
    play.className = "play";
    Object.assign(slider, { type: "range", min: 0, max: frames - 1, step: 1, value: frame });
    slider.setAttribute("aria-label", "time");
    const show = (next) => {
      frame = figure.frame = ((next % frames) + frames) % frames;
      slider.value = frame;
      time.textContent = `${digits(Number((frame * data.interval).toPrecision(4)))} ${data.timeUnit}`;
      movers.forEach((move) => move(frame));
    };
    const run = (on) => {
      playing = on;
      play.textContent = on ? "Pause" : "Play";
      last = performance.now();
      if (on) requestAnimationFrame(tick);
    };
    // A cycle of a hundred frames takes four seconds.
    const tick = (now) => {
      if (!playing) return;
      const steps = Math.floor((now - last) / 40);
      if (steps > 0) {
        last += 40 * steps;
        show(frame + steps);
      }
      figure.ticks = (figure.ticks || 0) + 1;
      requestAnimationFrame(tick);
    };
    play.addEventListener("click", () => run(!playing));
    slider.addEventListener("input", () => { run(false); show(Number(slider.value)); });
    plot.tabIndex = 0;
    plot.addEventListener("keydown", (event) => {
      const acts = { " ": () => run(!playing), ArrowRight: () => { run(false); show(frame + 1); }, ArrowLeft: () => { run(false); show(frame - 1); }, Home: () => show(0) };
      if (!acts[event.key]) return;
      event.preventDefault();
      acts[event.key]();
    });

    figure.draw = (colours, states, width) => {
      movers = [];
      const parts = [];
      const columns = width < NARROW || !data.gears.length ? 1 : 2;
      const room = Math.floor((width - 14 * (columns - 1)) / columns);
      if (data.gears.length) parts.push(train(colours, states, room));
      parts.push(gauges(colours, states, room));
      plot.style.gridTemplateColumns = `repeat(${columns}, max-content)`;
      plot.replaceChildren(...parts);
      const entries = data.states.map((name, k) => {
        const entry = document.createElement("span");
        entry.innerHTML = `<svg width="22" height="12" aria-hidden="true"><rect width="22" height="12" fill="${states[k]}"/></svg>`;
        entry.append(" " + name);
        return entry;
      });
      control.replaceChildren(play, slider, time, ...entries);
      play.textContent = playing ? "Pause" : "Play";
      show(frame);
    };

    function train(colours, states, room) {
      const reach = (gear) => gear.radius * (1 + 5 / gear.teeth);
      const ends = (k, side) => Math[side > 0 ? "max" : "min"](...data.gears.map((gear) => gear.centre[k] + side * reach(gear)));
      const [left, right, low, high] = [ends(0, -1), ends(0, 1), ends(1, -1), ends(1, 1)];
      const unit = Math.max((right - left) / room, (high - low) / 460);
      const height = Math.ceil((high - low) / unit) + 8;
      const picture = svg("svg", { class: "train", width: room, height, viewBox: `0 0 ${room} ${height}`, role: "img", "aria-label": "the train", "font-family": FONT, fill: colours.ink });
      const X = (x) => room / 2 + (x - (left + right) / 2) / unit, Y = (y) => height / 2 - (y - (low + high) / 2) / unit;
      const gears = [...data.gears].sort((one, other) => Number(other.ring) - Number(one.ring) || other.radius - one.radius);
      for (const gear of gears) {
        const body = svg("path", { d: outline(gear), fill: colours.grid, stroke: colours.muted, "stroke-width": unit, "fill-rule": "evenodd", "vector-effect": "none" });
        picture.append(body);
        movers.push((k) => {
          const [x, y, turn] = gear.motion.slice(3 * k, 3 * k + 3);
          const angle = ((gear.turn * k + turn) * 180) / Math.PI;
          body.setAttribute("transform", `translate(${X(gear.centre[0] + x)} ${Y(gear.centre[1] + y)}) scale(${1 / unit} ${-1 / unit}) rotate(${angle})`);
        });
      }
      for (const gear of gears) {
        picture.append(words(gear.name, X(gear.centre[0]), Y(gear.ring ? gear.centre[1] - gear.radius * (1 + 4.1 / gear.teeth) : gear.centre[1] - 0.2 * gear.radius) + (gear.ring ? -2 : 12),
          { ...halo(colours), fill: colours.ink, "font-size": SMALL, "text-anchor": "middle" }));
      }
      for (const contact of data.contacts.filter((contact) => contact.point)) {
        const dot = svg("circle", { cx: X(contact.point[0]), cy: Y(contact.point[1]), r: 11, fill: "none", "stroke-width": 4 });
        picture.append(dot);
        movers.push((k) => dot.setAttribute("stroke", states[contact.state[k]]));
      }
      return picture;
    }

    // The deflection of each contact between its flanks.
    function gauges(colours, states, room) {
      const row = 46, height = row * data.contacts.length + 8;
      const picture = svg("svg", { class: "gauges", width: room, height, viewBox: `0 0 ${room} ${height}`, role: "img", "aria-label": "deflections", "font-family": FONT, fill: colours.ink });
      data.contacts.forEach((contact, j) => {
        const top = j * row + 6;
        const all = [...contact.deflection, ...contact.flanks];
        const [low, high] = [Math.min(...all), Math.max(...all)];
        const margin = 0.08 * (high - low) || 1;
        const X = (d) => 8 + ((d - low + margin) / (high - low + 2 * margin)) * (room - 16);
        const box = (from, to, state) => svg("rect", { x: from, y: top + 16, width: Math.max(0, to - from), height: 16, fill: states[state], opacity: 0.45 });
        const state = (name) => data.states.indexOf(name);
        const [drive, back] = contact.flanks.map(X);
        picture.append(words(room < 420 ? contact.name : `${contact.name}: deflection`, 8, top + 10, { "font-size": SMALL }),
          box(drive, room - 8, state("on the drive flank")), box(back === undefined ? 8 : back, drive, state("separated")));
        if (back !== undefined) picture.append(box(8, back, state("on the back flank")));
        const value = words("", room - 8, top + 10, { "font-size": SMALL, "text-anchor": "end" });
        const dot = svg("circle", { cy: top + 24, r: 7, stroke: colours.ink, "stroke-width": 1.2 });
        picture.append(value, dot);
        movers.push((k) => {
          dot.setAttribute("cx", X(contact.deflection[k]));
          dot.setAttribute("fill", states[contact.state[k]]);
          value.textContent = `${digits(Number(contact.deflection[k].toPrecision(4)))} ${data.unit}${room < 420 ? "" : `, ${data.states[contact.state[k]]}`}`;
        });
      });
      return picture;
    }
  }

  let theme, printed = 0;
  function draw(figure) {
    const shown = printed ? "light" : theme;
    const colours = COLOURS[shown];
    if (figure.data.states) return figure.draw(colours, figure.data.colours[shown], printed || figure.plot.clientWidth);
    const all = frames(figure, printed || figure.plot.clientWidth);
    legend(figure, colours);
    figure.plot.style.gridTemplateColumns = all.length ? `repeat(${all[0].columns}, max-content)` : "";
    figure.plot.replaceChildren(...all.map((frame, i) => sheet(figure, figure.data.panels[i], i, frame, colours)));
  }

  function turn(next) {
    theme = next;
    root.dataset.theme = theme;
    button.textContent = theme === "dark" ? "Light" : "Dark";
  }

  async function drawAll() {
    root.removeAttribute("data-drawn");
    for (const figure of figures) {
      draw(figure);
      await new Promise((next) => setTimeout(next));
    }
    root.dataset.drawn = figures.length;
  }

  figures.filter((figure) => figure.data.states).forEach(animate);
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const named = { "#dark": "dark", "#light": "light" }[location.hash];
  turn(named || (prefersDark.matches ? "dark" : "light"));
  prefersDark.addEventListener("change", (event) => { turn(event.matches ? "dark" : "light"); drawAll(); });
  button.hidden = false;
  button.addEventListener("click", () => { turn(theme === "dark" ? "light" : "dark"); drawAll(); });

  let width = innerWidth, pause;
  addEventListener("resize", () => {
    clearTimeout(pause);
    pause = setTimeout(() => { if (innerWidth !== width) { width = innerWidth; drawAll(); } }, 150);
  });
  // Paper is white, and as wide as a column of text.
  const print = (wide, shown) => () => { printed = wide; root.dataset.theme = shown || theme; figures.forEach(draw); };
  addEventListener("beforeprint", print(680, "light"));
  addEventListener("afterprint", print(0));
  drawAll();
})();

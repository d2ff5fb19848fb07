"use strict";
(() => {
  const NS = "http://www.w3.org/2000/svg";
  const data = JSON.parse(document.getElementById("data").textContent);
  const LEFT = 52, RIGHT = 12;

  const make = (name, attributes, parent, text) => {
    const node = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  };
  const html = (name, className, parent, text) => {
    const node = document.createElement(name);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  };
  const extent = (lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const v of list) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    if (!(low <= high)) return [0, 1];
    const room = 0.04 * (high - low) || 0.5;
    return [low - room, high + room];
  };
  const ticks = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const nice = [0.5, 1, 2, 5, 10].map((m) => m * power), least = Math.min(3, count - 1);
    const wide = nice.find((s) => s >= raw) || raw, between = (s) => Math.floor(high / s) - Math.ceil(low / s) + 1;
    // One mark alone tells no size: then the next narrower step.
    const step = between(wide) >= least ? wide : nice.filter((s) => s < wide).pop() || wide;
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < 1e-9 * step ? 0 : v);
    return [found, Math.max(0, -Math.floor(Math.log10(step)))];
  };
  const at = (times, values, t) => {
    if (!times.length || t < times[0] || t > times[times.length - 1]) return null;
    let a = 0, b = times.length - 1;
    while (b - a > 1) { const m = (a + b) >> 1; if (times[m] <= t) a = m; else b = m; }
    if (values[a] === null || values[b] === null) return null;
    const share = times[b] > times[a] ? (t - times[a]) / (times[b] - times[a]) : 0;
    return values[a] + share * (values[b] - values[a]);
  };
  const nearest = (times, t) => {
    let a = 0, b = times.length - 1;
    while (b - a > 1) { const m = (a + b) >> 1; if (times[m] <= t) a = m; else b = m; }
    return Math.abs(times[a] - t) <= Math.abs(times[b] - t) ? a : b;
  };

  // A chart: strips share the time axis; each holds series {kind: points|line|band, x, y, y2, label, css}.
  const chart = (figure, spec) => {
    // As wide as it is shown, so that its letters are as large as those of the page.
    const W = Math.max(300, Math.min(640, Math.round(figure.clientWidth) || 640));
    const strips = spec.strips, tops = [], heights = strips.map((s) => s.height || 190);
    let H = 8;
    heights.forEach((h) => { tops.push(H); H += h + 12; });
    H += 26;
    const whole = extent(strips.flatMap((s) => s.series.map((e) => e.x)));
    let first = Infinity, last = -Infinity;
    for (const strip of strips) for (const e of strip.series) if (e.x.length) { first = Math.min(first, e.x[0]); last = Math.max(last, e.x[e.x.length - 1]); }
    let view = whole.slice(), cursor = null, from = null;
    const within = (t) => Math.min(Math.max(t, view[0], first), view[1], last);
    const svg = make("svg", { viewBox: `0 0 ${W} ${H}`, tabindex: "0", role: "img", "aria-label": spec.label });
    figure.appendChild(svg);
    const readout = html("p", "readout", figure);
    readout.setAttribute("aria-live", "polite");
    const X = (t) => LEFT + ((t - view[0]) / (view[1] - view[0])) * (W - LEFT - RIGHT);
    const T = (x) => view[0] + ((x - LEFT) / (W - LEFT - RIGHT)) * (view[1] - view[0]);

    const draw = () => {
      svg.replaceChildren();
      strips.forEach((strip, k) => {
        const top = tops[k], height = heights[k];
        const inside = (e) => e.y.filter((_, i) => e.x[i] >= view[0] && e.x[i] <= view[1]);
        const [low, high] = extent(strip.series.flatMap((e) => (e.y2 ? [inside(e), e.y2.filter((_, i) => e.x[i] >= view[0] && e.x[i] <= view[1])] : [inside(e)])));
        const Y = (v) => top + height - ((v - low) / (high - low)) * height;
        const id = `clip${spec.id}-${k}`, clip = make("clipPath", { id }, svg);
        make("rect", { x: LEFT, y: top, width: W - LEFT - RIGHT, height }, clip);
        const [marks, digits] = ticks(low, high, height > 100 ? 5 : 3);
        for (const v of marks) {
          make("line", { x1: LEFT, x2: W - RIGHT, y1: Y(v), y2: Y(v), class: "grid" }, svg);
          // A long unit stands where the uppermost number would.
          if (strip.unit.length < 3 || Y(v) > top + 18) make("text", { x: LEFT - 6, y: Y(v) + 4, "text-anchor": "end" }, svg, v.toFixed(digits));
        }
        make("text", { x: 4, y: top + 11 }, svg, strip.unit);
        const inner = make("g", { "clip-path": `url(#${id})` }, svg);
        if (strip.zero) make("line", { x1: LEFT, x2: W - RIGHT, y1: Y(0), y2: Y(0), class: "zero" }, inner);
        for (const a of spec.areas || []) make("rect", { x: X(a[0]), y: top, width: Math.max(X(a[1]) - X(a[0]), 1), height, class: "fails" }, inner);
        for (const e of strip.series) {
          if (e.kind === "points") {
            let path = "";
            e.x.forEach((t, i) => { if (e.y[i] !== null && t >= view[0] && t <= view[1]) path += `M${X(t).toFixed(1)} ${(Y(e.y[i]) - 1.1).toFixed(1)}h1.4v2.2h-2.2v-2.2z`; });
            make("path", { d: path, class: e.css }, inner);
          } else if (e.kind === "band") {
            const there = e.x.map((_, i) => i).filter((i) => e.y[i] !== null && e.y2[i] !== null);
            const up = there.map((i) => `${X(e.x[i]).toFixed(1)} ${Y(e.y2[i]).toFixed(1)}`);
            const down = there.map((i) => `${X(e.x[i]).toFixed(1)} ${Y(e.y[i]).toFixed(1)}`).reverse();
            if (up.length) make("path", { d: `M${up.join("L")}L${down.join("L")}Z`, class: e.css }, inner);
          } else {
            let path = "", pen = "M";
            e.x.forEach((t, i) => { if (e.y[i] === null) { pen = "M"; return; } path += `${pen}${X(t).toFixed(1)} ${Y(e.y[i]).toFixed(1)}`; pen = "L"; });
            make("path", { d: path, class: `line ${e.css}`, ...(e.stroke ? { style: `stroke:${e.stroke}` } : {}), ...(e.dash ? { "stroke-dasharray": e.dash } : {}) }, inner);
          }
        }
        for (const m of spec.marks || []) if (m.at >= view[0] && m.at <= view[1]) make("line", { x1: X(m.at), x2: X(m.at), y1: top, y2: top + height, class: m.css }, inner);
      });
      const [marks, digits] = ticks(view[0], view[1], W < 450 ? 4 : 6);
      if (spec.names) spec.names.forEach((name, k) => { if (k >= view[0] && k <= view[1]) make("text", { x: X(k), y: H - 18, "text-anchor": k === 0 ? "start" : k === spec.names.length - 1 ? "end" : "middle" }, svg, name); });
      else for (const t of marks) make("text", { x: X(t), y: H - 18, "text-anchor": "middle" }, svg, t.toFixed(digits));
      make("text", { x: W - RIGHT, y: H - 4, "text-anchor": "end" }, svg, spec.axis);
      if (cursor !== null) make("line", { x1: X(cursor), x2: X(cursor), y1: 8, y2: H - 34, class: "cursor" }, svg);
      if (from !== null && cursor !== null) make("rect", { x: Math.min(X(from), X(cursor)), y: 8, width: Math.abs(X(from) - X(cursor)), height: H - 42, class: "chosen" }, svg);
    };
    const tell = () => {
      if (cursor === null) { readout.textContent = ""; return; }
      // All that is told stands at one time, the nearest measurement's: else the residual would not be what the numbers differ by.
      const read = strips[0].series.find((e) => e.kind === "points" && e.x.length);
      const near = read && cursor >= read.x[0] && cursor <= read.x[read.x.length - 1] ? read.x[nearest(read.x, cursor)] : cursor;
      const when = spec.names ? Math.round(cursor) : near;
      const parts = [spec.names ? spec.names[when] : `${Number(when.toFixed(2))} ${spec.axis}`];
      for (const strip of strips) for (const e of strip.series) {
        const here = e.kind === "points" && e.x.length ? nearest(e.x, when) : -1;
        const value = e.kind === "points" ? (here >= 0 && e.x[here] === when ? e.y[here] : null) : at(e.x, e.y, when);
        const other = e.kind === "band" ? at(e.x, e.y2, when) : null;
        if (value !== null) parts.push(`${e.label} ${value.toFixed(2)}${other !== null ? ` to ${other.toFixed(2)}` : ""} ${strip.unit}`);
      }
      readout.textContent = parts.join("; ");
    };
    // No closer than that two of the places that are drawn stand in it.
    const shown = (a, b) => Math.max(...strips.flatMap((s) => s.series.map((e) => e.x.filter((t) => t >= a && t <= b).length)));
    const show = (a, b) => { if (b > a && shown(a, b) > 1) view = [Math.max(a, whole[0]), Math.min(b, whole[1])]; draw(); };
    const scale = (factor) => {
      const middle = cursor === null ? (view[0] + view[1]) / 2 : cursor, half = ((view[1] - view[0]) * factor) / 2;
      show(middle - half, middle + half);
    };
    const where = (event) => {
      const box = svg.getBoundingClientRect();
      return within(T(((event.clientX - box.left) / box.width) * W));
    };
    svg.addEventListener("pointermove", (event) => { cursor = where(event); draw(); tell(); });
    svg.addEventListener("pointerdown", (event) => {
      cursor = where(event);
      if (event.pointerType !== "touch") {
        from = cursor;
        if (event.isTrusted) svg.setPointerCapture(event.pointerId);
      }
      draw();
      tell();
    });
    svg.addEventListener("pointerup", (event) => {
      const to = where(event), start = from;
      from = null;
      if (start !== null && Math.abs(to - start) > 0.01 * (view[1] - view[0])) show(Math.min(start, to), Math.max(start, to)); else draw();
    });
    svg.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") { from = null; cursor = null; draw(); tell(); } });
    svg.addEventListener("dblclick", () => show(whole[0], whole[1]));
    svg.addEventListener("keydown", (event) => {
      const step = (view[1] - view[0]) / 50, middle = cursor === null ? view[0] : cursor;
      if (event.key === "ArrowRight") cursor = within(middle + step);
      else if (event.key === "ArrowLeft") cursor = within(middle - step);
      else if (event.key === "Home") cursor = within(view[0]);
      else if (event.key === "End") cursor = within(view[1]);
      else if (event.key === "+" || event.key === "=") scale(0.5);
      else if (event.key === "-") scale(2);
      else if (event.key === "Escape" || event.key === "0") { cursor = null; show(whole[0], whole[1]); }
      else return;
      event.preventDefault();
      draw();
      tell();
    });
    const tools = html("div", "tools", figure);
    for (const [name, act] of [["Zoom in", () => scale(0.5)], ["Zoom out", () => scale(2)], ["All", () => show(whole[0], whole[1])]]) {
      const button = html("button", "", tools, name);
      button.type = "button";
      button.setAttribute("aria-label", `${name}: ${spec.title}`);
      button.addEventListener("click", act);
    }
    draw();
  };

  document.querySelectorAll("figure[data-chart]").forEach((figure) => {
    const number = Number(figure.dataset.chart);
    chart(figure, { ...data.charts[number], id: number });
  });

  // The table: sorted by a press on a heading; copied, or saved as CSV, in the order that is shown.
  const table = document.getElementById("records"), body = table.tBodies[0], said = document.getElementById("said");
  const cells = (row) => [...row.cells].map((c) => (c.dataset.value !== undefined ? c.dataset.value : c.textContent));
  table.querySelectorAll("th button").forEach((button, column) => {
    button.addEventListener("click", () => {
      const head = button.parentElement, up = head.getAttribute("aria-sort") !== "ascending";
      table.querySelectorAll("th").forEach((th) => th.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const key = (row) => cells(row)[column], number = (text) => (text === "" ? NaN : Number(text));
      const order = (a, b) => {
        const x = key(a), y = key(b), p = number(x), q = number(y);
        if (x === "" || y === "") return x === y ? 0 : x === "" ? 1 : -1;
        const less = Number.isNaN(p) || Number.isNaN(q) ? x.localeCompare(y, undefined, { numeric: true }) : p - q;
        return up ? less : -less;
      };
      body.append(...[...body.rows].sort(order));
      said.textContent = `sorted by ${button.textContent}, ${up ? "least" : "greatest"} first`;
    });
  });
  const harmless = (text) => (/^[=+\-@\t\r]/.test(text) && Number.isNaN(Number(text)) ? `'${text}` : text);
  const rows = () => [[...table.tHead.rows[0].cells].map((c) => c.textContent), ...[...body.rows].map(cells)].map((r) => r.map(harmless));
  const csv = () => rows().map((r) => r.map((c) => (/[",\n]/.test(c) ? `"${c.replaceAll('"', '""')}"` : c)).join(",")).join("\n") + "\n";
  document.getElementById("copy").addEventListener("click", () => {
    const text = rows().map((r) => r.map((c) => c.replace(/[\t\n]/g, " ")).join("\t")).join("\n");
    const area = html("textarea", "", document.body, text);
    const done = () => { area.remove(); said.textContent = "copied"; };
    if (navigator.clipboard && window.isSecureContext) navigator.clipboard.writeText(text).then(done, () => { area.select(); document.execCommand("copy"); done(); });
    else { area.select(); document.execCommand("copy"); done(); }
  });
  document.getElementById("save").addEventListener("click", () => {
    const link = html("a", "", document.body);
    link.href = URL.createObjectURL(new Blob(["\ufeff", csv()], { type: "text/csv" }));
    link.download = `${data.command}.csv`;
    link.click();
    link.remove();
    said.textContent = `saved as ${link.download}`;
  });
})();

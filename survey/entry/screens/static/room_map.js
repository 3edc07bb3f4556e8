// The room map: walls, points, and the line that the laser is to take.

const SVG = "http://www.w3.org/2000/svg";

export function drawMap(svg, caption, map, target) {
  for (const child of [...svg.children]) if (child.tagName !== "title") child.remove();
  const all = [...map.points.map((p) => [p.x, p.y]), ...map.walls.flat()];
  if (!all.length) return;
  const xs = all.map(([x]) => x);
  const ys = all.map(([, y]) => -y);
  const margin = 0.6;
  const [left, top] = [Math.min(...xs) - margin, Math.min(...ys) - margin];
  const [width, height] = [Math.max(...xs) - left + margin, Math.max(...ys) - top + margin];
  svg.setAttribute("viewBox", `${left} ${top} ${width} ${height}`);
  const unit = Math.max(width, height) / 100;
  for (const wall of map.walls) {
    add(svg, "polyline", { class: "wall", points: wall.map(([x, y]) => `${x},${-y}`).join(" "), "stroke-width": unit * 0.5 });
  }
  const place = new Map(map.points.map((p) => [p.name, p]));
  const [from, to] = [place.get(target?.from), place.get(target?.to)];
  if (from && to) add(svg, "line", { class: "line", x1: from.x, y1: -from.y, x2: to.x, y2: -to.y, "stroke-width": unit * 0.6 });
  for (const point of map.points) drawPoint(svg, point, target, unit);
  caption.textContent = target ? describe(from, to, target) : "";
}

function drawPoint(svg, point, target, unit) {
  const role = point.name === target?.from ? "from" : point.name === target?.to ? "to" : "";
  const size = unit * (role ? 2 : 1.1);
  const style = { class: `point ${point.kind} ${point.sure ? "" : "rough"} ${role}`, "stroke-width": unit * 0.3 };
  if (role === "from") add(svg, "rect", { ...style, x: point.x - size, y: -point.y - size, width: 2 * size, height: 2 * size });
  else add(svg, "circle", { ...style, cx: point.x, cy: -point.y, r: size });
  if (point.kind === "mark" && !role) return; // the marks of a stop lie close together
  const text = add(svg, "text", { class: role, x: point.x + size, y: -point.y - size, "font-size": unit * (role ? 5.5 : 3.6) });
  text.textContent = point.name;
}

function describe(from, to, target) {
  const missing = [!from && target.from, !to && target.to].filter(Boolean);
  if (missing.length) return `${missing.join(" and ")}: place not known yet.`;
  return `Square: laser on ${target.from}. Blue: point at ${target.to}.`;
}

function add(parent, name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

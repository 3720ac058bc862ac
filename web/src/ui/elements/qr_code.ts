import { correction, generate } from "lean-qr";
import { svg } from "./dom";

const QUIET = 4; // modules around it, ISO/IEC 18004

/** A QR code as one path: scannable on the dark page, and free of inline styles. */
export function qrCode(text: string): SVGSVGElement {
  const code = generate(text, { minCorrectionLevel: correction.L });
  const size = code.size + 2 * QUIET;
  const drawing = svg("svg", { viewBox: `0 0 ${size} ${size}`, class: "qr", role: "img" });
  drawing.setAttribute("aria-label", "QR code of the link");
  const ground = svg("rect", { width: `${size}`, height: `${size}`, fill: "#fff" });
  const modules: string[] = [];
  for (let y = 0; y < code.size; y++)
    for (let x = 0; x < code.size; x++)
      if (code.get(x, y)) modules.push(`M${x + QUIET} ${y + QUIET}h1v1h-1z`);
  drawing.append(ground, svg("path", { d: modules.join(""), fill: "#000", "shape-rendering": "crispEdges" }));
  return drawing;
}

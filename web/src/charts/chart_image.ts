import type { TimeChart } from "./time_chart";

const MARGIN = 24;
const HEAD = 36; // the title
const KEYS = 56; // a chart's name and keys
const GAP = 20;
const FONT = "Inter, system-ui, sans-serif";

/** One picture of all charts with their names, line samples and figures; at the resolution of the screen. */
export async function chartPicture(charts: readonly TimeChart[], title: string): Promise<Blob> {
  const scale = devicePixelRatio;
  const widest = Math.max(...charts.map((chart) => chart.canvas.width));
  const heights = charts.map((chart) => chart.canvas.height + (KEYS + GAP) * scale);
  const canvas = document.createElement("canvas");
  canvas.width = widest + 2 * MARGIN * scale;
  canvas.height = heights.reduce((sum, height) => sum + height, 0) + (HEAD + 2 * MARGIN) * scale;
  const drawing = canvas.getContext("2d");
  if (drawing === null) throw new Error("no drawing context");
  drawing.fillStyle = "#0b0e11";
  drawing.fillRect(0, 0, canvas.width, canvas.height);
  write(drawing, title, MARGIN * scale, (MARGIN + 18) * scale, `600 ${17 * scale}px ${FONT}`);
  let top = (MARGIN + HEAD) * scale;
  for (const [at, chart] of charts.entries()) {
    drawChart(drawing, chart, top, scale);
    top += heights[at] ?? 0;
  }
  const blob = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, "image/png"));
  if (blob === null) throw new Error("the picture could not be made");
  return blob;
}

function drawChart(drawing: CanvasRenderingContext2D, chart: TimeChart, top: number, scale: number): void {
  const left = MARGIN * scale;
  const { title, unit } = chart.spec;
  const name = unit === "" ? title : `${title} (${unit})`;
  write(drawing, name, left, top + 16 * scale, `600 ${16 * scale}px ${FONT}`);
  let across = left;
  for (const line of chart.spec.lines) {
    drawing.strokeStyle = line.stroke;
    drawing.lineWidth = line.width * scale;
    drawing.setLineDash(line.dash.map((length) => length * scale));
    drawing.beginPath();
    drawing.moveTo(across, top + 38 * scale);
    drawing.lineTo(across + 36 * scale, top + 38 * scale);
    drawing.stroke();
    across += 44 * scale;
    across += write(drawing, line.label, across, top + 43 * scale, `${14 * scale}px ${FONT}`) + 24 * scale;
  }
  drawing.drawImage(chart.canvas, left, top + KEYS * scale);
}

/** Returns how wide it is. */
function write(drawing: CanvasRenderingContext2D, text: string, x: number, y: number, font: string): number {
  drawing.font = font;
  drawing.fillStyle = "#e8edf2";
  drawing.fillText(text, x, y);
  return drawing.measureText(text).width;
}

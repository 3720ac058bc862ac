/** Where a panel stands around the operator: m from the eyes, who look along -z, y up. */
export interface PanelPlace {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly turn: number; // rad about the vertical: it faces the operator
  readonly width: number;
  readonly height: number;
}

const DISTANCE = 1.6; // where eyes rest well in a headset
const MAIN = { width: 1.7, height: 1.28 };
const SMALL = { width: 0.76, height: 0.6 };
const APART = 0.06;
const LIFT = 0.12; // the middle of the large picture over the eyes: what is below is nearer to the rest of the gaze

/** The large picture in front; the others in two columns beside it, the right one first, nearest to the eyes' height. */
export function layoutPanels(shapes: readonly number[]): PanelPlace[] {
  return shapes.map((shape, index) => {
    const size = fit(shape, index === 0 ? MAIN : SMALL);
    if (index === 0) return { x: 0, y: LIFT, z: -DISTANCE, turn: 0, ...size };
    const side = index % 2 === 1 ? 1 : -1;
    const row = Math.floor((index - 1) / 2);
    const angle =
      side * (Math.atan2(MAIN.width / 2, DISTANCE) + Math.atan2(SMALL.width / 2 + APART, DISTANCE));
    const step = SMALL.height + APART;
    const y = LIFT + (row === 0 ? 0 : (row % 2 === 1 ? 1 : -1) * Math.ceil(row / 2) * step);
    return { x: DISTANCE * Math.sin(angle), y, z: -DISTANCE * Math.cos(angle), turn: -angle, ...size };
  });
}

/** The largest of this shape (width by height) in the box. */
function fit(shape: number, box: { width: number; height: number }): { width: number; height: number } {
  const known = shape > 0 && Number.isFinite(shape) ? shape : 4 / 3;
  const width = Math.min(box.width, box.height * known);
  return { width, height: width / known };
}

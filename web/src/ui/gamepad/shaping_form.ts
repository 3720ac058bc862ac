import { SHAPING_BOUNDS } from "../../gamepad/shaping";
import { DEFAULT_SHAPING, shapeStick, type PadShaping } from "../../gamepad/stick_shape";
import { percent } from "../../gamepad/labels";
import { button, h, setText, svg } from "../elements/dom";

const FIELDS: readonly (readonly [name: keyof PadShaping, label: string, about: string])[] = [
  ["deadzone", "Deadzone", "Travel around the middle that does nothing"],
  ["expo", "Expo", "How gentle the stick is near its middle"],
  ["slow", "Slow", "Speed while the slow button is held"],
  ["normal", "Normal", "Speed without a modifier button"],
  ["turbo", "Turbo", "Speed while the turbo button is held"],
];
const SIZE = 100; // of the drawing of the curve

/** How a pad feels: its settings, and the curve that they make. */
export class ShapingForm {
  readonly element = h("div", "pad-shaping");
  private shaping: PadShaping = DEFAULT_SHAPING;
  private shown = "";
  private readonly curve = svg("path", { class: "pad-curve" });
  private readonly hint = h("p", "pad-hint");
  private readonly inputs = new Map<keyof PadShaping, { input: HTMLInputElement; value: HTMLElement }>();

  constructor(private readonly changed: (shaping: PadShaping) => void) {
    const rows = FIELDS.map(([name, label, about]) => this.createRow(name, label, about));
    const drawing = svg("svg", {
      viewBox: `-4 -4 ${SIZE + 8} ${SIZE + 8}`,
      class: "pad-curve-drawing",
      role: "img",
      "aria-label": "Speed over stick travel",
    });
    drawing.append(svg("path", { d: `M0 0V${SIZE}H${SIZE}`, class: "gauge-ring" }), this.curve);
    const defaults = button("field-button", "Defaults", () => this.set(DEFAULT_SHAPING));
    const aside = h("div", "pad-curve-box");
    aside.append(drawing, h("span", "pad-dial-name", {}, "Speed over travel"), defaults);
    this.element.append(h("div", "pad-rows", {}, ...rows, this.hint), aside);
  }

  /** Writes only what changed. */
  show(shaping: PadShaping): void {
    const shown = JSON.stringify(shaping);
    if (shown === this.shown) return;
    this.shown = shown;
    this.shaping = shaping;
    for (const [name, { input, value }] of this.inputs) {
      input.value = String(Math.round(shaping[name] * 100));
      setText(value, percent(shaping[name]));
    }
    this.curve.setAttribute("d", curvePath(shaping));
    const turbo = shaping.turbo > shaping.normal;
    setText(
      this.hint,
      turbo ? "" : "Turbo adds nothing while normal is as fast. 100 % is the robot's own limit.",
    );
  }

  private set(shaping: PadShaping): void {
    this.show(shaping);
    this.changed(shaping);
  }

  private createRow(name: keyof PadShaping, label: string, about: string): HTMLElement {
    const [least, most] = SHAPING_BOUNDS[name].map((bound) => String(Math.round(bound * 100)));
    const id = `pad-${name}`;
    const input = h("input", "slider", {
      type: "range",
      id,
      min: least ?? "0",
      max: most ?? "100",
      step: "1",
    });
    input.addEventListener("input", () => this.set({ ...this.shaping, [name]: Number(input.value) / 100 }));
    const value = h("output", "pad-row-value", { for: id });
    this.inputs.set(name, { input, value });
    return h(
      "div",
      "pad-row",
      { title: about },
      h("label", "setting-label", { for: id }, label),
      input,
      value,
    );
  }
}

function curvePath(shaping: PadShaping): string {
  const points = Array.from({ length: 51 }, (_, at) => {
    const travel = at / 50;
    const speed = shapeStick(travel, shaping) * shaping.normal;
    return `${(travel * SIZE).toFixed(1)} ${((1 - speed) * SIZE).toFixed(1)}`;
  });
  return `M${points.join("L")}`;
}

import { ACTIONS } from "../../gamepad/layout";
import type { PadReading, PadSnapshot } from "../../gamepad/mapping";
import { CONTROL_NAMES } from "../../gamepad/labels";
import { h, setData, setText, svg } from "../elements/dom";

/** Every axis and button of a pad as the browser gives them. */
export class RawView {
  readonly element = h("div", "pad-raw");
  private shape = "";
  private axes: { bar: HTMLElement; value: HTMLElement }[] = [];
  private buttons: HTMLElement[] = [];

  update(pad: PadSnapshot): void {
    this.build(pad);
    for (const [index, { bar, value }] of this.axes.entries()) {
      const raw = pad.axes[index] ?? 0;
      const share = Math.min(1, Math.max(-1, raw));
      bar.style.left = `${(50 + Math.min(0, share) * 50).toFixed(1)}%`;
      bar.style.width = `${(Math.abs(share) * 50).toFixed(1)}%`;
      setText(value, raw.toFixed(2));
    }
    for (const [index, element] of this.buttons.entries()) {
      const button = pad.buttons[index];
      setData(element, "pressed", String(button?.pressed ?? false));
    }
  }

  private build(pad: PadSnapshot): void {
    const shape = `${pad.id} ${pad.axes.length} ${pad.buttons.length}`;
    if (shape === this.shape) return;
    this.shape = shape;
    const lines = h("div", "pad-axes");
    this.axes = [...pad.axes.keys()].map((index) => {
      const bar = h("span", "pad-bar-fill");
      const value = h("span", "pad-axis-value");
      lines.append(h("span", "pad-axis-name", {}, `Axis ${index}`), h("span", "pad-bar", {}, bar), value);
      return { bar, value };
    });
    this.buttons = [...pad.buttons.keys()].map((index) => h("span", "pad-button", {}, `${index}`));
    this.element.replaceChildren(lines, h("div", "pad-buttons", {}, ...this.buttons));
  }
}

/** What a pad means to the robot: sticks, triggers, cross, and what its buttons do. */
export class ControlsView {
  readonly element = h("div", "pad-controls");
  private readonly left = createStickDial("Left stick");
  private readonly right = createStickDial("Right stick");
  private readonly cross = createStickDial("Cross");
  private readonly triggers = h("span", "pad-bar-fill");
  private readonly chips = new Map(
    ACTIONS.map((action) => [action, h("span", "pad-chip", {}, CONTROL_NAMES[action])]),
  );

  constructor() {
    const triggers = h("div", "pad-dial", {}, h("span", "pad-bar", {}, this.triggers));
    triggers.append(h("span", "pad-dial-name", {}, "Triggers"));
    const chips = h("div", "pad-chips", {}, ...this.chips.values());
    this.element.append(
      h("div", "pad-dials", {}, this.left.element, this.right.element, this.cross.element, triggers),
      chips,
    );
  }

  update({ inputs, pressed }: PadReading): void {
    this.left.show(inputs.left_x, inputs.left_y);
    this.right.show(inputs.right_x, inputs.right_y);
    this.cross.show(inputs.dpad_x, inputs.dpad_y);
    const share = inputs.triggers;
    this.triggers.style.left = `${(50 + Math.min(0, share) * 50).toFixed(1)}%`;
    this.triggers.style.width = `${(Math.abs(share) * 50).toFixed(1)}%`;
    for (const [action, chip] of this.chips) setData(chip, "pressed", String(pressed.has(action)));
  }
}

function createStickDial(name: string): { element: HTMLElement; show(x: number, y: number): void } {
  const dot = svg("circle", { r: "7", class: "pad-dot" });
  const drawing = svg("svg", {
    viewBox: "-50 -50 100 100",
    class: "pad-dial-drawing",
    "aria-hidden": "true",
  });
  drawing.append(
    svg("circle", { r: "46", class: "gauge-ring" }),
    svg("path", { d: "M-46 0H46M0-46V46", class: "gauge-ring faint" }),
    dot,
  );
  const element = h("div", "pad-dial");
  element.append(drawing, h("span", "pad-dial-name", {}, name));
  return {
    element,
    show(x, y) {
      dot.setAttribute("cx", (x * 39).toFixed(1));
      dot.setAttribute("cy", (y * 39).toFixed(1));
    },
  };
}

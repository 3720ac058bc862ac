import { padName, setupOf } from "../../gamepad/profile";
import { setupLabel } from "../../gamepad/labels";
import type { Pad } from "../../input/gamepad";
import { button, h, setData, setHidden, setText } from "../elements/dom";

export interface PadListEvents {
  calibrate(gamepad: Gamepad): void;
}

/** The pads that are plugged in; one of them drives. */
export class PadList {
  readonly element = h("section", "pad-list", { "aria-label": "Gamepads" });
  private readonly rows = h("ul", "pad-rows-list");
  private readonly empty = h("div", "pad-empty");
  private shape = "";

  constructor(
    private readonly pad: Pad,
    private readonly events: PadListEvents,
  ) {
    this.empty.append(
      h("strong", "", {}, "No gamepad"),
      h(
        "p",
        "",
        {},
        "Plug one in, or connect it by Bluetooth, and press any of its buttons: browsers show a pad only then.",
      ),
    );
    this.element.append(this.rows, this.empty);
  }

  update(): void {
    const pads = this.pad.all();
    const current = this.pad.state?.gamepad.index ?? null;
    const { profiles } = this.pad.storage.saved;
    setHidden(this.empty, pads.length > 0);
    const words = pads.map((pad) => setupLabel(setupOf(pad, profiles), pad.index === current));
    const shape = pads.map((pad, at) => `${pad.index} ${pad.id} ${words[at]}`).join("\n");
    if (shape === this.shape) return;
    this.shape = shape;
    this.rows.replaceChildren(
      ...pads.map((pad, at) => this.createRow(pad, pad.index === current, words[at] ?? "")),
    );
  }

  private createRow(gamepad: Gamepad, inUse: boolean, words: string): HTMLElement {
    const name = h("strong", "pad-name", { title: gamepad.id }, padName(gamepad.id));
    const about = h(
      "span",
      "pad-about",
      {},
      `${words} · ${gamepad.axes.length} axes, ${gamepad.buttons.length} buttons`,
    );
    const use = button("field-button", "Use", () => {
      this.pad.choose(gamepad);
      setText(use, "In use");
    });
    use.setAttribute("aria-label", `Use ${padName(gamepad.id)}`);
    setHidden(use, inUse);
    const calibrate = button("field-button", "Calibrate", () => this.events.calibrate(gamepad));
    calibrate.setAttribute("aria-label", `Calibrate ${padName(gamepad.id)}`);
    const row = h("li", "pad-item", {}, h("div", "pad-who", {}, name, about), use, calibrate);
    setData(row, "current", String(inUse));
    return row;
  }
}

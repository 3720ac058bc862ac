import type { PadLayout } from "../../gamepad/layout";
import { padName, setupOf } from "../../gamepad/profile";
import { MAX_STORE_CHARS } from "../../gamepad/profile_file";
import type { ForceFeedbackLoader } from "../../haptics/force_feedback_loader";
import type { Display } from "../../input/display";
import type { Pad } from "../../input/gamepad";
import { saveFile } from "../elements/save_file";
import { button, h, setData, setHidden, setText, type Panel } from "../elements/dom";
import { ControlsView } from "./live_inputs";
import { PadList } from "./pad_list";
import { ShapingForm } from "./shaping_form";
import { CalibrationWizard } from "./calibration_wizard";
import type { SheetContent } from "../elements/sheet";

/** Which pad drives, what its parts do, and how it feels. */
export function createGamepadSheet(pad: Pad, forces: ForceFeedbackLoader, display: Display): SheetContent {
  return new PadSheet(pad, forces, display);
}

class PadSheet implements SheetContent {
  readonly name = "pads";
  readonly title = "Gamepads";
  readonly element = h("div", "sheet-body pads");
  private readonly list: PadList;
  private readonly overview = h("div", "pad-overview");
  private readonly wizard: CalibrationWizard;
  private readonly controls = new ControlsView();
  private readonly heading = h("h3", "list-head");
  private readonly current = h("section", "pad-current", { "aria-label": "Gamepad in use" });
  private readonly forget = button("field-button", "Forget calibration", () => this.forgetCurrent());
  private readonly words = h("p", "form-trouble", { role: "alert" });
  private readonly form = new ShapingForm((shaping) => {
    const state = this.pad.state;
    if (state === null) return;
    const { calibrated, layout } = state.setup;
    this.pad.storage.save({ id: state.id, layout: calibrated ? layout : null, shaping });
  });
  private calibrated: Gamepad | null = null; // being calibrated
  private frame = 0;
  private readonly forcePlace = h("div");
  private force: Panel | null = null; // until its code is there; it stays away where there is no force feedback

  constructor(
    private readonly pad: Pad,
    private readonly forces: ForceFeedbackLoader,
    private readonly display: Display,
  ) {
    this.list = new PadList(pad, { calibrate: (gamepad) => this.calibrate(gamepad) });
    this.wizard = new CalibrationWizard({
      save: (layout) => this.keep(layout),
      cancel: () => this.leaveWizard(),
    });
    this.current.append(this.heading, this.controls.element, this.form.element);
    this.overview.append(this.list.element, this.current, this.forcePlace, this.createFoot(), this.words);
    this.element.append(this.overview, this.wizard.element);
  }

  opened(): void {
    this.leaveWizard();
    void this.addForces();
    const step = (now: number): void => {
      this.frame = this.display.request(step);
      this.update(now);
    };
    step(performance.now());
  }

  closed(): void {
    this.display.cancel(this.frame);
    this.leaveWizard();
  }

  private update(now: number): void {
    setHidden(this.overview, this.calibrated !== null);
    setHidden(this.wizard.element, this.calibrated === null);
    if (this.calibrated !== null) this.updateWizard(this.calibrated, now);
    else this.updateOverview();
  }

  private updateOverview(): void {
    this.list.update();
    this.force?.update(0);
    const { state, storage } = this.pad;
    setHidden(this.current, state?.ready !== true);
    setHidden(this.forget, state?.setup.calibrated !== true);
    if (storage.trouble !== null) setText(this.words, storage.trouble);
    if (state === null || !state.ready) return;
    setText(this.heading, state.name);
    this.controls.update(state);
    // Of the profiles as they are now: the pad itself is read a moment later.
    this.form.show(setupOf(state.gamepad, storage.saved.profiles).shaping);
  }

  private updateWizard(gamepad: Gamepad, now: number): void {
    // Some browsers hand out a new object with every reading.
    const live = this.pad.all().find((each) => each.index === gamepad.index && each.id === gamepad.id);
    if (live === undefined) {
      this.leaveWizard();
      setText(this.words, `${padName(gamepad.id)} was disconnected: nothing was changed`);
      return;
    }
    this.wizard.update(live, setupOf(live, this.pad.storage.saved.profiles).shaping, now);
  }

  private async addForces(): Promise<void> {
    const forces = await this.forces.load();
    if (forces === null || this.force !== null) return;
    const { createForceSection } = await import("./force_section");
    this.force ??= createForceSection(forces);
    this.forcePlace.replaceChildren(this.force.element);
  }

  private calibrate(gamepad: Gamepad): void {
    this.calibrated = gamepad;
    this.pad.suspend(true);
    setData(this.element, "mode", "wizard");
    setText(this.words, "");
    this.wizard.begin();
  }

  private leaveWizard(): void {
    this.calibrated = null;
    this.pad.suspend(false);
    setData(this.element, "mode", "overview");
    setText(this.words, "");
    setHidden(this.overview, false);
    setHidden(this.wizard.element, true);
  }

  private keep(layout: PadLayout): void {
    const gamepad = this.calibrated;
    if (gamepad === null) return;
    const { shaping } = setupOf(gamepad, this.pad.storage.saved.profiles);
    this.pad.storage.save({ id: gamepad.id, layout, shaping });
    this.pad.choose(gamepad);
    this.leaveWizard();
  }

  private forgetCurrent(): void {
    const state = this.pad.state;
    if (state !== null) this.pad.storage.forget(state.id);
  }

  private createFoot(): HTMLElement {
    const file = h("input", "", { type: "file", accept: "application/json,.json", hidden: "" });
    file.addEventListener("change", () => void this.importFile(file));
    const load = button("field-button", "Import…", () => file.click());
    const keep = button("field-button", "Export", () => {
      saveFile(new Blob([this.pad.storage.export()], { type: "application/json" }), "lockstep-pads.json");
    });
    return h("div", "pad-foot", {}, this.forget, h("span", "pad-spread"), load, keep, file);
  }

  private async importFile(file: HTMLInputElement): Promise<void> {
    const chosen = file.files?.[0];
    file.value = "";
    if (chosen === undefined) return;
    const text = chosen.size > 4 * MAX_STORE_CHARS ? "" : await chosen.text();
    const trouble = this.pad.storage.import(text);
    setText(this.words, trouble ?? "");
  }
}

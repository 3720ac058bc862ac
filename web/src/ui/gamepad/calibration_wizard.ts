import {
  CALIBRATION_STEPS,
  createCalibration,
  currentStep,
  goBack,
  layoutOf,
  observe,
  skip,
  type Calibration,
} from "../../gamepad/calibration";
import type { PadLayout } from "../../gamepad/layout";
import { readPad, type PadReading, type PadSnapshot, type SeenAtRest } from "../../gamepad/mapping";
import type { PadShaping } from "../../gamepad/stick_shape";
import { calibrationPrompt } from "../../gamepad/labels";
import { button, h, setData, setHidden, setText } from "../elements/dom";
import { ControlsView, RawView } from "./live_inputs";

export interface WizardEvents {
  save(layout: PadLayout): void;
  cancel(): void;
}

/** What has to be tried before a calibration can be kept. */
interface Trial {
  readonly seen: SeenAtRest;
  deadmanPressed: boolean;
  deadmanLetGo: boolean;
  stopPressed: boolean;
  stickMoved: boolean;
}

/** Guides through the calibration of one pad, question by question, and lets it be tried before it is kept. */
export class CalibrationWizard {
  readonly element = h("section", "pad-wizard", { "aria-label": "Calibration" });
  private calibration: Calibration = createCalibration();
  private trial: Trial = createTrial();
  private readonly progress = h("span", "pad-progress-fill");
  private readonly count = h("span", "pad-count");
  private readonly what = h("strong", "pad-ask", { role: "status" });
  private readonly about = h("p", "pad-about");
  private readonly trouble = h("p", "form-trouble", { role: "alert" });
  private readonly raw = new RawView();
  private readonly controls = new ControlsView();
  private readonly checks = h("ul", "pad-checks");
  private readonly back = button("field-button", "Back", () => goBack(this.calibration));
  private readonly skip = button("field-button", "Skip", () => void skip(this.calibration));
  private readonly again = button("field-button", "Start over", () => this.begin());
  private readonly save = button("field-button primary", "Save", () => this.finish());

  constructor(private readonly events: WizardEvents) {
    const cancel = button("field-button", "Cancel", () => this.events.cancel());
    const head = h("div", "pad-progress", {}, this.count, h("span", "pad-progress-line", {}, this.progress));
    const foot = h("div", "pad-foot", {}, cancel, this.again, this.back, this.skip, this.save);
    const card = h("div", "pad-card", {}, this.what, this.about, this.trouble, this.checks);
    this.element.append(head, card, this.controls.element, this.raw.element, foot);
  }

  begin(): void {
    this.calibration = createCalibration();
    this.trial = createTrial();
  }

  /** Takes what the pad says now, and shows where the calibration stands. */
  update(pad: PadSnapshot, shaping: PadShaping, now: number): void {
    observe(this.calibration, pad, now);
    this.raw.update(pad);
    const layout = layoutOf(this.calibration);
    setData(this.element, "phase", this.calibration.phase);
    setHidden(this.controls.element, layout === null);
    setHidden(this.checks, layout === null);
    setHidden(this.raw.element, layout !== null);
    setHidden(this.save, layout === null);
    setHidden(this.again, layout === null);
    setHidden(this.skip, layout !== null || currentStep(this.calibration)?.required !== false);
    this.back.disabled = this.calibration.at === 0;
    this.progress.style.width = `${(100 * this.calibration.at) / CALIBRATION_STEPS.length}%`;
    if (layout === null) this.ask();
    else this.test(readPad(pad, layout, shaping, this.trial.seen));
  }

  private ask(): void {
    this.trial = createTrial();
    const { what, about, trouble } = calibrationPrompt(this.calibration);
    setText(this.count, `${this.calibration.at + 1} of ${CALIBRATION_STEPS.length}`);
    setText(this.what, this.calibration.phase === "letting_go" ? "Let go of everything" : what);
    setText(this.about, this.calibration.phase === "letting_go" ? "Lay the pad down for a moment." : about);
    setText(this.trouble, trouble);
  }

  private test(reading: PadReading): void {
    const { trial } = this;
    trial.stopPressed ||= reading.pressed.has("stop");
    if (reading.pressed.has("deadman")) trial.deadmanPressed = true;
    else trial.deadmanLetGo ||= trial.deadmanPressed;
    trial.stickMoved ||= Math.hypot(reading.inputs.left_x, reading.inputs.left_y) > 0.5;
    this.controls.update(reading);
    setText(this.count, "Try it");
    setText(this.what, "Try it before you save");
    setText(this.about, "Nothing that you do here reaches the robot.");
    setText(this.trouble, "");
    this.showChecks([
      [trial.deadmanPressed && trial.deadmanLetGo, "Hold to move: press it and let go"],
      [trial.stopPressed, "STOP: press it"],
      [trial.stickMoved, "Left stick: push it, and see that the dot goes the same way"],
    ]);
    this.save.disabled = !(trial.deadmanLetGo && trial.stopPressed && trial.stickMoved);
  }

  private showChecks(checks: readonly (readonly [boolean, string])[]): void {
    while (this.checks.childElementCount < checks.length) this.checks.append(h("li", "pad-check"));
    for (const [index, [done, words]] of checks.entries()) {
      const item = this.checks.children[index];
      if (!(item instanceof HTMLElement)) continue;
      setText(item, words);
      setData(item, "done", String(done));
    }
  }

  private finish(): void {
    const layout = layoutOf(this.calibration);
    if (layout !== null && !this.save.disabled) this.events.save(layout);
  }
}

function createTrial(): Trial {
  return {
    seen: new Set(),
    deadmanPressed: false,
    deadmanLetGo: false,
    stopPressed: false,
    stickMoved: false,
  };
}

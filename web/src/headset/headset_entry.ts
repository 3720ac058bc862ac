import { addDisarmLabels } from "../drive/labels/labels";
import { note } from "../session/console_state";
import { button, setHidden, type Panel } from "../ui/elements/dom";
import { HEADSET_DISARM_LABELS } from "./disarm_labels";
import { createHeadsetSettings, HandSettingsStorage } from "./headset_settings";
import type { HeadsetMode, HeadsetPage } from "./headset_session";

const LABELS: Readonly<Record<HeadsetMode, string>> = {
  "immersive-vr": "Enter VR",
  "immersive-ar": "Enter AR",
};
const MODES = ["immersive-vr", "immersive-ar"] as const;
const FEATURES: XRSessionInit = { requiredFeatures: ["local-floor"], optionalFeatures: ["hand-tracking"] };

/** Opens the headset's view where the browser has WebXR; its code is loaded when it is wanted. */
export class HeadsetEntry {
  private readonly buttons = new Map<HeadsetMode, HTMLButtonElement[]>();
  private readonly supported = new Set<HeadsetMode>();
  private isOpening = false;
  private readonly hand = new HandSettingsStorage();

  constructor(private readonly page: HeadsetPage) {
    addDisarmLabels(HEADSET_DISARM_LABELS);
    const { xr } = navigator as { xr?: XRSystem }; // absent where the page has no TLS
    if (xr === undefined) return;
    void this.look(xr);
    xr.addEventListener("devicechange", () => void this.look(xr));
  }

  /** Buttons that show themselves when a headset is there. */
  createButtons(className: string): HTMLButtonElement[] {
    return MODES.map((mode) => {
      const made = button(className, LABELS[mode], () => void this.enter(mode));
      setHidden(made, !this.supported.has(mode));
      this.buttons.set(mode, [...(this.buttons.get(mode) ?? []), made]);
      return made;
    });
  }

  /** The settings of the hands, where a headset is present and the robot has a pose to drive. */
  createSettings(): Panel {
    const { state } = this.page.engine;
    return createHeadsetSettings(
      this.hand,
      () => this.supported.size > 0 && (state.robot?.description.poses.length ?? 0) > 0,
    );
  }

  private async look(xr: XRSystem): Promise<void> {
    for (const mode of MODES) {
      const found = await xr.isSessionSupported(mode).catch(() => false);
      if (found) this.supported.add(mode);
      else this.supported.delete(mode);
      for (const each of this.buttons.get(mode) ?? []) setHidden(each, !found);
    }
  }

  /** The session is asked for at once: a browser gives it only while the click is fresh. */
  private async enter(mode: HeadsetMode): Promise<void> {
    const { xr } = navigator as { xr?: XRSystem };
    const { engine } = this.page;
    if (xr === undefined || this.isOpening || engine.display.isImmersive) return;
    this.isOpening = true;
    engine.driving.disarm("operator"); // the window may stand still from now on
    const asked = xr.requestSession(mode, FEATURES);
    try {
      const [session, { HeadsetSession }] = await Promise.all([asked, import("./headset_session")]);
      await HeadsetSession.begin(session, this.page, mode, () => this.hand.settings);
    } catch (error) {
      await asked.then((session) => session.end()).catch(() => undefined); // else it shows nothing, and does not end
      const why = error instanceof Error ? error.message : String(error);
      note(engine.state, "error", `The headset view did not open: ${why}`, Date.now());
    } finally {
      this.isOpening = false;
    }
  }
}

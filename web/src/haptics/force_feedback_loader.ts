import type { ForceContext, ForceFeedback, Hid } from "./force_feedback";
import type { PushingStick } from "./haptics";

const KEPT = "lockstep.force"; // where force_feedback.ts keeps the stick

/** Force feedback, whose code most pages never need: it comes when the pads' sheet opens, or with a stick that was chosen before. */
export class ForceFeedbackLoader {
  private loading: Promise<ForceFeedback | null> | null = null;

  constructor(
    private readonly engine: ForceContext & { readonly haptics: { stick: PushingStick | null } | null },
  ) {
    if (wasChosen()) void this.load();
  }

  /** Null where the browser has no WebHID, or the console does not allow it. */
  async load(): Promise<ForceFeedback | null> {
    try {
      return await (this.loading ??= this.begin());
    } catch {
      this.loading = null; // its file did not come: the next try may have it
      return null;
    }
  }

  private async begin(): Promise<ForceFeedback | null> {
    const { hid } = navigator as { readonly hid?: Hid };
    if (hid === undefined) return null;
    const code = await import("./force_feedback");
    const forces = new code.ForceFeedback(hid, this.engine);
    if (!(await forces.resume())) return null;
    if (this.engine.haptics !== null) this.engine.haptics.stick = forces;
    return forces;
  }
}

function wasChosen(): boolean {
  try {
    return localStorage.getItem(KEPT) !== null;
  } catch {
    return false;
  }
}

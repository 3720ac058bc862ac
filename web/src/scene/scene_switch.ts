import type { ConsoleEngine } from "../engine/console_engine";
import { readChoice, sceneAnswer, type ScenePreference, type SceneFacts } from "./scene_preference";

const KEY = "lockstep.scene";
const SMALL_SCREEN = matchMedia("(max-width: 999px)");
const REDUCED_DATA = matchMedia("(prefers-reduced-data: reduce)");

/** What Chromium says of the network; other browsers say nothing. */
interface NetworkInformation {
  readonly saveData?: boolean;
  readonly downlink?: number; // Mbit/s
}

/** Whether the 3D scene stands on the page: as the person has decided, else by what this machine can. */
export class SceneSwitch {
  isOn = false;
  private choice = keptChoice();
  private renderer: string | null | undefined = undefined;
  private streamsMs: number | null = null; // since when there are streams; null: there are none
  private gaveUp = false; // not again before the page is loaded anew, or somebody asks

  /** Whether the person has asked for it. */
  get isWanted(): boolean {
    return this.choice === "shown";
  }

  /** The person's own decision, which is kept. */
  toggle(): void {
    this.isOn = !this.isOn;
    this.gaveUp = false;
    this.choice = this.isOn ? "shown" : "hidden";
    try {
      localStorage.setItem(KEY, this.choice);
    } catch {
      // storage is switched off: it holds until the page closes
    }
  }

  /** This machine draws it too slowly, or not at all. */
  giveUp(): void {
    this.isOn = false;
    this.gaveUp = true;
  }

  update(engine: ConsoleEngine, now: number): void {
    this.streamsMs = engine.state.welcome === null ? null : (this.streamsMs ?? now);
    const { robot } = engine.state;
    if (robot === null || this.gaveUp) return;
    if (robot.description.bodies.length === 0) this.isOn = false;
    if (this.isOn) return;
    const answer = sceneAnswer(this.facts(engine, now));
    if (answer === "ask") this.renderer = hardwareRenderer();
    else this.isOn = answer === "show";
  }

  private facts(engine: ConsoleEngine, now: number): SceneFacts {
    const { state } = engine;
    const network = (navigator as { connection?: NetworkInformation }).connection;
    return {
      choice: this.choice,
      described: (state.robot?.description.bodies.length ?? 0) > 0,
      small: SMALL_SCREEN.matches,
      savesData: network?.saveData === true || REDUCED_DATA.matches,
      megabits: network?.downlink ?? null,
      limited: (state.quality?.reason ?? "") !== "",
      pictureAgeMs: this.pictureAge(engine, now),
      armed: engine.driving.isArmed(),
      renderer: this.renderer,
    };
  }

  /** A robot without cameras has all the pictures that it will have. */
  private pictureAge(engine: ConsoleEngine, now: number): number | null {
    const hasCameras = engine.state.welcome?.streams.some((stream) => stream.kind === "video") !== false;
    const since = hasCameras ? engine.firstPictureMs : this.streamsMs;
    return since === null ? null : now - since;
  }
}

function keptChoice(): ScenePreference | null {
  try {
    return readChoice(localStorage.getItem(KEY));
  } catch {
    return null;
  }
}

/** What WebGL draws with; null where the browser says that it would be slow, or has none. */
function hardwareRenderer(): string | null {
  const canvas = document.createElement("canvas");
  const drawing = canvas.getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (drawing === null) return null;
  const unmasked = drawing.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL;
  const name: unknown = drawing.getParameter(unmasked ?? drawing.RENDERER);
  drawing.getExtension("WEBGL_lose_context")?.loseContext();
  return typeof name === "string" ? name : null;
}

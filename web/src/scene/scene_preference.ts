/** What the person decided about the 3D scene, kept in the browser. */
export type ScenePreference = "shown" | "hidden";

/** What speaks for and against a 3D scene that nobody has asked for. */
export interface SceneFacts {
  readonly choice: ScenePreference | null; // null: the person has not decided
  readonly described: boolean; // the robot says its shape
  readonly small: boolean; // the screen is a phone's
  readonly savesData: boolean; // the person asked the browser or the system to
  readonly megabits: number | null; // per second, that the browser expects of the network; null: it does not say
  readonly limited: boolean; // the console holds this page's pictures back: the path carries no more
  readonly pictureAgeMs: number | null; // since the first picture was drawn; null: none was
  readonly armed: boolean;
  readonly renderer: string | null | undefined; // of WebGL; null: no graphics hardware; undefined: not asked yet
}

/** `ask`: only what draws is not known yet. `wait`: not yet. `none`: it stays away until a fact changes. */
export type SceneAnswer = "show" | "ask" | "wait" | "none";

/** The pictures come first, and the sound after them. */
const AFTER_PICTURE_MS = 2000;
/** What draws the scene has 140 kB: half a second of such a network. */
const MIN_MEGABITS = 2;
/** Renderers that draw with the processor that also decodes the pictures and sends the commands. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|lavapipe|swrast|software|basic render/i;

/**
 * Whether the 3D scene comes by itself: on request, or where this machine and its network have room for it. Either
 * way it waits for the pictures, and does not change the page under somebody who drives.
 */
export function sceneAnswer(facts: SceneFacts): SceneAnswer {
  if (!facts.described || facts.choice === "hidden") return "none";
  if (facts.choice === null && !hasRoom(facts)) return "none";
  if (facts.armed || facts.pictureAgeMs === null || facts.pictureAgeMs < AFTER_PICTURE_MS) return "wait";
  if (facts.choice === "shown") return "show";
  if (facts.renderer === undefined) return "ask";
  return drawsInHardware(facts.renderer) ? "show" : "none";
}

export function drawsInHardware(renderer: string | null): boolean {
  return renderer !== null && !SOFTWARE.test(renderer);
}

/** What was kept in the browser; null: nothing that is known. */
export function readChoice(text: string | null): ScenePreference | null {
  return text === "shown" || text === "hidden" ? text : null;
}

function hasRoom({ small, savesData, megabits, limited }: SceneFacts): boolean {
  return !small && !savesData && !limited && (megabits === null || megabits >= MIN_MEGABITS);
}

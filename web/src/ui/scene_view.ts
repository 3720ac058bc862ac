import type { ConsoleApi } from "../rtc/console_api";
import { button, h, setText } from "./dom";

type SceneState = "off" | "loading" | "on" | "failed";

const IDLE_WORDS = "The robot, posed from its feedback";
const SETTLE_MS = 5000;

/** The 3D scene in a frame of its own. It runs only while it is the large view: drawing it takes from the pictures. */
export class SceneView {
  readonly element = h("div", "scene");
  private readonly words = h("p", "scene-words");
  private readonly open = button("wide-button", "Open the 3D scene", () => this.load());
  private frame: HTMLIFrameElement | null = null;
  private state: SceneState = "off";
  private openedMs = 0;

  /** `onkey`: keys pressed while the frame has the focus, which the page itself never sees. */
  constructor(
    private readonly api: ConsoleApi,
    private readonly onkey: (event: KeyboardEvent) => void,
  ) {
    this.element.append(h("div", "scene-idle", {}, this.words, this.open));
    this.show("off", IDLE_WORDS);
  }

  /** Opens the scene unless it is open. */
  load(): void {
    if (this.state === "on" || this.state === "loading") return;
    this.show("loading", "Opening the 3D scene…");
    this.api.scene().then(
      (path) => this.embed(path),
      () => this.show("failed", "The 3D scene is not available"),
    );
  }

  /** Ends it; what it drew is gone with it. */
  unload(words = IDLE_WORDS): void {
    if (this.state === "off") return;
    this.frame?.remove();
    this.frame = null;
    this.show("off", words);
  }

  /** Whether it has run long enough that its loading no longer holds the page up. */
  hasSettled(now: number): boolean {
    return this.state === "on" && now - this.openedMs > SETTLE_MS;
  }

  /** Opens it anew if it is open. */
  reload(): void {
    if (this.state === "off") return;
    this.unload();
    this.load();
  }

  private embed(path: string): void {
    if (this.state !== "loading") return;
    this.frame = h("iframe", "scene-frame", { src: path, title: "3D scene of the robot" });
    this.watchKeys(this.frame);
    this.element.append(this.frame);
    this.openedMs = performance.now();
    this.show("on", "");
  }

  /** The frame comes from our own origin, so its window can be listened to. */
  private watchKeys(frame: HTMLIFrameElement): void {
    frame.addEventListener("load", () => {
      frame.contentWindow?.addEventListener("keydown", (event) => this.onkey(event), { capture: true });
    });
  }

  private show(state: SceneState, words: string): void {
    this.state = state;
    this.element.dataset["state"] = state;
    setText(this.words, words);
  }
}

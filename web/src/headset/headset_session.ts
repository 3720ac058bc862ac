import { WebGLRenderer } from "three";
import type { ConsoleEngine } from "../engine/console_engine";
import type { HeadsetStatistics } from "../engine/headset_statistics";
import { robotIsUp } from "../session/console_state";
import { pressedStopLabel, restingStopLabel } from "../stop/stop_labels";
import { knownGap, veilWords, type PlacedPicture } from "../ui/views/view_grid";
import { grab, isSilent, type HeadsetEvent, type Side } from "../xr/headset_input";
import type { RobotDescription } from "../protocol/wire";
import type { HandSettings } from "../xr/hand_mapping";
import type { ButtonName } from "../xr/headset_buttons";
import { PoseDevice } from "../xr/pose_drive";
import type { RigidPose } from "../util/rigid";
import { Battery } from "./battery";
import { Hands } from "./hands";
import { HeadsetView, type ViewCamera } from "./headset_view";
import { ResetHold } from "./reset_hold";
import { headsetStatus, resetWords, type FrameFigures } from "./status";
import { readHands, trackedPose } from "./xr_hands";

export type HeadsetMode = "immersive-ar" | "immersive-vr";

/** The page that the headset shows. */
export interface HeadsetPage {
  readonly engine: ConsoleEngine;
  readonly grid: { pictures(): PlacedPicture[]; mainStream(): string | null };
}

const STATUS_MS = 100; // between two readings of what the panel says
const DEAD_MS = 10_000; // a visible session without frames ends
const SMOOTH = 0.1; // share of the newest frame in the shown times

/**
 * One immersive session. Its frames are the page's frames, and whether it is visible says whether the page is: arming,
 * gate and veils go on with the window silent. Each of its ends leaves the robot at rest and the page disarmed.
 */
export class HeadsetSession {
  readonly frame: { -readonly [Name in keyof FrameFigures]: FrameFigures[Name] } = {
    intervalMs: null,
    workMs: null,
    waitedMs: null,
  };
  private readonly hands = new Hands();
  private readonly view: HeadsetView;
  private readonly battery: Battery;
  private viewer: RigidPose | null = null;
  private frames = 0;
  private poses: { readonly description: RobotDescription; readonly device: PoseDevice } | null = null;
  private isEnded = false;
  private isPlaced = false;
  private silentSinceMs: number | null = null; // a visible session without frames; null: it has some
  private readonly resetHold = new ResetHold();
  private status: ReturnType<typeof headsetStatus> | null = null;
  private statusMs = -Infinity;
  private reset: ReturnType<typeof resetWords> = null;

  private constructor(
    private readonly session: XRSession,
    private readonly renderer: WebGLRenderer,
    private readonly page: HeadsetPage,
    private readonly mode: HeadsetMode,
    private readonly handSettings: () => HandSettings,
  ) {
    this.view = new HeadsetView(mode === "immersive-vr");
    this.battery = new Battery(() => page.engine.driving.disarm("battery_low"));
  }

  /** Shows the page in `session` until it ends. Rejects, with the session ended, where the browser cannot draw it. */
  static async begin(
    session: XRSession,
    page: HeadsetPage,
    mode: HeadsetMode,
    handSettings: () => HandSettings,
  ): Promise<HeadsetSession> {
    let renderer: WebGLRenderer | null = null;
    try {
      renderer = new WebGLRenderer({ antialias: true, alpha: true });
      renderer.xr.enabled = true;
      renderer.xr.setReferenceSpaceType("local-floor");
      const made = new HeadsetSession(session, renderer, page, mode, handSettings);
      session.addEventListener("end", () => made.ended());
      await renderer.xr.setSession(session);
      made.start();
      return made;
    } catch (error) {
      renderer?.dispose();
      await session.end().catch(() => undefined);
      throw error;
    }
  }

  /** With every tick of the page, frames or not. A window that is seen beside a silent headset is still judged. */
  step(now: number): void {
    if (!isSilent(this.hands.input, now)) {
      this.silentSinceMs = null;
      return;
    }
    const { engine } = this.page;
    if (engine.driving.isArmed()) engine.driving.disarm("headset_silent");
    engine.display.frame(now);
    this.silentSinceMs ??= now;
    // A fault in what draws it: no frame follows, and what is shown there would stand.
    if (this.session.visibilityState !== "visible") this.silentSinceMs = null;
    else if (now - this.silentSinceMs > DEAD_MS) this.end();
  }

  statistics(): HeadsetStatistics {
    return {
      mode: this.mode,
      visibility: this.session.visibilityState,
      frames: this.frames,
      frame_ms: this.frame.intervalMs,
      work_ms: this.frame.workMs,
      picture_wait_ms: this.frame.waitedMs,
      held: [...this.hands.input.held],
      hands: this.hands.readings.map(({ sample }) => ({ side: sample.side, tracked: sample.pose !== null })),
      panels: this.view.pictures.map(({ streams, veil }) => ({
        left: streams.left,
        right: streams.right,
        veil,
      })),
      state: this.status?.title ?? "",
      text: this.status?.text ?? "",
      reset: this.reset?.text ?? null,
      pointed: { left: this.buttonAt("left"), right: this.buttonAt("right") },
      figures: Object.fromEntries(
        (this.status?.figures ?? []).map(({ label, value, unit }) => [label, `${value} ${unit}`.trim()]),
      ),
      way: Object.fromEntries((this.status?.way ?? []).map(({ name, ms }) => [name, ms])),
      battery: this.battery.level,
    };
  }

  private start(): void {
    if (this.isEnded) throw new Error("the session ended while it was opened");
    const { engine } = this.page;
    const { session, renderer } = this;
    renderer.xr.setFoveation(0); // what is at the edge of the view is text
    engine.driving.disarm("operator"); // who puts a headset on arms anew, in it
    const seen = {
      get visible(): boolean {
        return session.visibilityState === "visible";
      },
    };
    engine.display.enter(seen);
    engine.controls.headset = this.hands;
    engine.headset = this;
    engine.tracing?.show(true, performance.now(), "headset");
    session.addEventListener("visibilitychange", () => {
      if (session.visibilityState === "hidden") engine.driving.disarm("headset_off");
      else if (session.visibilityState === "visible-blurred") engine.driving.disarm("headset_blurred");
    });
    renderer.xr.getReferenceSpace()?.addEventListener("reset", () => {
      // The headset calls another place its origin: every pose that was known means another place.
      engine.driving.disarm("tracking_lost");
      this.isPlaced = false;
    });
    renderer.domElement.addEventListener("webglcontextlost", () => this.end());
    const loop = (_time: number, frame?: XRFrame): void => {
      if (frame === undefined) return;
      try {
        this.draw(frame);
      } catch (error) {
        // No frame would follow: what the headset shows would stand, and STOP would be out of reach in it.
        reportError(error);
        this.end();
      }
    };
    renderer.setAnimationLoop(loop);
  }

  private ended(): void {
    const { engine } = this.page;
    this.isEnded = true;
    engine.driving.disarm("headset_left");
    this.renderer.setAnimationLoop(null);
    if (engine.headset === this) {
      engine.headset = null;
      engine.controls.headset = null;
      const { goals } = engine.driving;
      if (goals !== null && goals.device === this.poses?.device) goals.device = null;
      engine.display.leave();
      engine.tracing?.show(false, performance.now(), "headset");
    }
    this.battery.close();
    this.view.close();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** A view that is not drawn any more would go on showing its last picture as if it were the present one. */
  private end(): void {
    this.page.engine.driving.disarm("headset_left");
    this.session.end().catch(() => undefined); // it has ended
  }

  private draw(frame: XRFrame): void {
    const began = performance.now();
    const space = this.renderer.xr.getReferenceSpace();
    if (space === null) return;
    this.frames += 1;
    if (this.frames > 1)
      this.frame.intervalMs = smooth(this.frame.intervalMs, began - this.hands.input.frameMs);
    this.read(frame, space, began);
    const { engine } = this.page;
    engine.controls.events.changed(began);
    engine.ticker.frame(began);
    engine.display.frame(began);
    this.show(performance.now());
    this.renderer.render(this.view.scene, this.view.camera);
    this.frame.workMs = smooth(this.frame.workMs, performance.now() - began);
  }

  private read(frame: XRFrame, space: XRReferenceSpace, now: number): void {
    this.viewer = trackedPose(frame.getViewerPose(space));
    if (this.viewer === null) this.page.engine.driving.disarm("tracking_lost");
    else if (!this.isPlaced) this.recentre();
    const readings = readHands(frame, space, this.session.inputSources);
    for (const event of this.hands.take(readings, now)) this.carryOut(event, now);
    const { hands } = this.hands.input;
    const isOnReset = (side: Side): boolean =>
      hands.get(side)?.pressed === true && this.buttonAt(side) === "reset";
    const heldMs = this.resetHold.step(isOnReset, now);
    if (heldMs !== null) this.page.engine.stopping.reset(heldMs, now);
    this.takePoses();
  }

  /** The hands lead the poses of the robot that is there now. */
  private takePoses(): void {
    const { driving, state } = this.page.engine;
    const { goals } = driving;
    const description = state.robot?.description;
    if (goals === null || description === undefined || this.poses?.description === description) return;
    const device = new PoseDevice(description, {
      pose: (side) => {
        const { held, hands } = this.hands.input;
        return held.has(side) ? (hands.get(side)?.pose ?? null) : null;
      },
      forward: () => this.view.forward,
      panel: (camera) => this.view.panelOf(camera),
      settings: () => this.handSettings(),
    });
    this.poses = { description, device };
    goals.device = device;
  }

  private carryOut(event: HeadsetEvent, now: number): void {
    const { engine } = this.page;
    if (event.kind === "arm") this.arm(event.side);
    else if (event.kind === "press") this.press(event, now);
    else if (event.kind === "lost") engine.driving.disarm(event.why);
    else if (event.kind === "stop") engine.stop("headset button");
    else if (event.kind === "layer") engine.driving.selectLayer();
    else this.recentre();
  }

  /** A squeeze arms by the page's own rules; refused, it is for nothing, and the hand has to open first. */
  private arm(side: Side): void {
    const { engine } = this.page;
    if (this.viewer === null) return;
    if (!engine.driving.isArmed()) engine.toggleArmed();
    if (engine.driving.isArmed()) grab(this.hands.input, side);
  }

  private buttonAt(side: Side): ButtonName | null {
    return this.view.buttonAt(side, this.hands.input.held.has(side));
  }

  /** `drives`: with this press, or before it. */
  private press({ side, drives }: { readonly side: Side; readonly drives: boolean }, now: number): void {
    const button = this.view.buttonAt(side, drives);
    if (button === "stop") this.page.engine.stop("headset button");
    else if (button === "recentre") this.recentre();
    else if (button === "leave") this.end();
    else if (button === "reset") this.resetHold.press(side, now);
  }

  private recentre(): void {
    if (this.viewer === null) return;
    this.isPlaced = true;
    this.view.recentre(this.viewer);
  }

  /** What the gate has drawn, and for what it is veiled now: nothing is drawn in between. */
  private show(now: number): void {
    const { engine, grid } = this.page;
    const main = grid.mainStream();
    if (this.status === null || now - this.statusMs >= STATUS_MS) {
      this.status = headsetStatus(engine, main, this.frame, now);
      this.statusMs = now;
    }
    const heard = engine.hears(now) && robotIsUp(engine.state);
    const fate = engine.stopping.fate(now);
    const state = {
      cameras: grid.pictures().map((picture) => viewCamera(engine, picture, now)),
      main,
      status: this.status,
      stop:
        fate === null
          ? engine.state.stop.stopped
            ? restingStopLabel(true, heard, true)
            : "B or Y, or point and pull"
          : pressedStopLabel(fate, heard),
      reset: (this.reset = resetWords(engine, now)),
    };
    this.view.update(state, this.hands.readings, this.hands.input.held, now);
    for (const panel of this.view.pictures)
      if (panel.streams.left === main && panel.waitedMs !== null && panel.uploadedMs === now)
        this.frame.waitedMs = smooth(this.frame.waitedMs, panel.waitedMs);
  }
}

function viewCamera(engine: ConsoleEngine, { name, label, canvas }: PlacedPicture, now: number): ViewCamera {
  const video = engine.streams.videos.get(name);
  const gap = knownGap(engine, name, now);
  const tolerance = engine.state.settings.tolerance.video;
  return {
    name,
    label,
    canvas,
    drawnMs: video?.lastDrawnMs ?? null,
    gap: gap === null ? "" : `gap ${gap} of ${tolerance}`,
    veil: veilWords(engine, name, now),
  };
}

function smooth(before: number | null, value: number): number {
  return before === null ? value : before + SMOOTH * (value - before);
}

import { forceOf } from "../../haptics/contact_force";
import { createForceTrace, noteForce } from "../../haptics/force_trace";
import { elapsed } from "../../session/recording_labels";
import { dayLabel } from "../recording_list";
import { CAMERA, MICROPHONE, type ReplayFeedback } from "../chunk";
import { clampedEvent, timeOf } from "../index_table";
import { replayHash, type ReplayLink } from "../replay_link";
import { roleOf } from "../../util/url_fragment";
import { eventGap } from "../../gate/serial";
import { ConsoleError } from "../../transport/signalling/console_api";
import { requestErrorLabel } from "../../transport/signalling/session_api";
import { button, grouped, h, setData, setHidden, setText } from "../../ui/elements/dom";
import { createForceGauge } from "../../ui/driving/force_gauge";
import { AxisRows } from "./axis_rows";
import { downloadRecording, mayDownload } from "./list_view";
import { MarkList } from "./mark_list";
import { Player, type ShownMoment } from "../player";
import type { RecordingDetails, RecordingsApi } from "../recordings_api";
import { SceneCard } from "./scene_card";
import { SoundCard } from "./sound_card";
import { Timeline } from "./timeline";
import { ToolOverlay } from "../../media/tool_overlay";
import { createPlaybackControls, type PlaybackControls } from "./playback_controls";

interface CameraView {
  readonly element: HTMLElement;
  /** `paint`: draws over the picture. */
  show(
    picture: VideoFrame | undefined,
    stamp: number | null,
    event: number,
    trouble: string,
    paint: (context: CanvasRenderingContext2D) => void,
  ): void;
}

/** One recording: its pictures, figures and marks, all of one event. */
export class PlayerView {
  readonly element = h("main", "player");
  readonly player: Player;
  readonly sounds: SoundCard;
  readonly rendered = new Map<string, { stamp: number; event: number }[]>(); // by camera, for tests
  private readonly cameras = new Map<string, CameraView>();
  private readonly tools = new ToolOverlay(() => this.player.description);
  private readonly timeline = new Timeline((event) => void this.player.seek(event));
  private readonly marks: MarkList;
  private readonly transport: PlaybackControls;
  private readonly number = h("output", "event-number", {}, "–");
  private readonly when = h("span", "event-rate");
  private readonly state = h("p", "replay-state");
  private readonly trouble = h("p", "library-trouble", { role: "alert" });
  private readonly damage = h("span", "tag bad");
  readonly scene: SceneCard | null; // null: the robot does not describe its shape
  private readonly axes: AxisRows | null;
  private readonly gauge: { element: HTMLElement; update(now: number): void } | null;
  private readonly trace = createForceTrace();
  private readonly force: Parameters<typeof createForceGauge>[0] & {
    state: { feedback: ReplayFeedback | null };
  };

  constructor(
    private readonly api: RecordingsApi,
    private readonly details: RecordingDetails,
    private readonly token: string,
    back: () => void,
  ) {
    const { description, index } = details;
    this.player = new Player(api, details, {
      shown: (shown) => this.show(shown),
      changed: () => this.update(),
    });
    this.force = {
      measuredMs: null,
      state: { robot: description === null ? null : { description }, feedback: null },
      haptics: { trace: this.trace },
    };
    this.axes = description === null ? null : new AxisRows(description);
    this.gauge = (description?.wrench ?? null) === null ? null : createForceGauge(this.force, false);
    const labels = new Map(
      [...(description?.cameras ?? []), ...(description?.microphones ?? [])].map((each) => [
        each.name,
        each.label,
      ]),
    );
    const microphones = index.topics.filter((topic) => topic.startsWith(MICROPHONE));
    this.sounds = new SoundCard(microphones, labels);
    this.marks = new MarkList(
      (mark) => void this.player.seekMark(mark),
      () => this.update(),
    );
    this.transport = createPlaybackControls(this.player, () => this.marks.shown);
    this.scene = description === null || description.bodies.length === 0 ? null : new SceneCard(description);
    const views = this.player.cameras.length + (this.scene === null ? 0 : 1);
    const pictures = h("div", "replay-pictures", { "data-count": String(views) });
    for (const topic of this.player.cameras) {
      const name = topic.slice(CAMERA.length);
      const view = createCameraView(name, labels.get(name) ?? name);
      this.cameras.set(topic, view);
      pictures.append(view.element);
    }
    if (this.scene !== null) pictures.append(this.scene.element);
    if (views === 0) pictures.append(h("p", "replay-empty", {}, "This recording has no pictures."));
    const event = h(
      "section",
      "card event",
      { "aria-label": "Event reference" },
      h("div", "event-head", {}, h("h2", "", {}, "Event"), this.when),
      this.number,
      this.state,
    );
    const rail = h("aside", "replay-rail", {}, event, ...(this.axes === null ? [] : [this.axes.element]));
    if (this.gauge !== null) rail.append(h("section", "card replay-force", {}, this.gauge.element));
    rail.append(this.sounds.element, this.marks.element);
    const deck = h("footer", "replay-deck", {}, this.timeline.element, this.transport.element);
    this.element.append(this.createHead(back), this.trouble, pictures, rail, deck);
  }

  /** Where it begins: at the event of a link, or at its first; of what is being recorded at the newest. */
  start(event: number | null): void {
    const { index, isRunning } = this.player;
    if (index.lastEvent === 0) this.update();
    else if (event !== null) void this.player.seek(clampedEvent(index, event));
    else if (isRunning) this.player.toNewest();
    else void this.player.seek(index.firstEvent);
  }

  isOf(link: ReplayLink): boolean {
    return link.token === this.token && link.recording === this.details.entry.id;
  }

  close(): void {
    this.player.close();
    this.scene?.close();
  }

  /** Left and right step, space plays, P shows or hides the tools' frames; true: it was one of these. */
  key(event: KeyboardEvent): boolean {
    if (this.transport.key(event)) return true;
    const isPlain = !event.ctrlKey && !event.metaKey && !event.altKey;
    if (event.key !== "p" || !isPlain || !this.hasTools) return false;
    this.tools.toggle();
    if (this.player.shown !== null) this.show(this.player.shown);
    return true;
  }

  private get hasTools(): boolean {
    return (this.player.description?.poses.length ?? 0) > 0;
  }

  private createHead(back: () => void): HTMLElement {
    const { entry } = this.details;
    const told = h("span", "copy-told", { role: "status" });
    const copy = button("chip-button", "Copy link", () => void this.copyLink(told));
    const tools = h("div", "bar-tools", {}, told, copy);
    if (mayDownload(roleOf(this.token)))
      tools.append(button("chip-button", "Download", () => void this.download()));
    return h(
      "header",
      "replay-head",
      {},
      button("chip-button", "‹ Recordings", back),
      h("span", "replay-title", {}, entry.name === "" ? entry.robot || entry.id : entry.name),
      h(
        "span",
        "muted replay-about",
        {},
        [entry.name === "" ? "" : entry.robot, dayLabel(entry.started)].filter(Boolean).join(" · "),
      ),
      this.damage,
      tools,
    );
  }

  private show(shown: ShownMoment): void {
    const { moment, pictures, troubles } = shown;
    const { event } = moment.place;
    const description = this.player.description;
    for (const [topic, view] of this.cameras) {
      const shownPicture = moment.pictures.get(topic);
      const stamp = shownPicture?.record.event ?? null;
      view.show(pictures.get(topic), stamp, event, troubles.get(topic) ?? "", (context) => {
        const state = shownPicture?.feedback;
        if (description !== null && state !== undefined)
          this.tools.paintState(context, topic.slice(CAMERA.length), description, state);
      });
      if (stamp !== null && pictures.has(topic))
        this.rendered.set(topic.slice(CAMERA.length), [{ stamp, event }]);
    }
    const { feedback, command } = moment;
    this.scene?.show(event, feedback, moment.damaged);
    const unknown = new Set(
      feedback?.unknown.map((name) => description?.axes.findIndex((axis) => axis.name === name) ?? -1),
    );
    this.axes?.show(command?.values ?? [], feedback?.axes ?? [], feedback?.goals ?? [], unknown);
    this.force.state.feedback = feedback;
    if (feedback !== null) noteForce(this.trace, event, forceOf(feedback.wrench));
    void this.sounds.show(moment.sounds, moment.damaged);
    setText(this.number, grouped(event));
    setText(this.state, stateWords(shown));
    setData(this.state, "tone", feedback?.stopped === true ? "bad" : "");
    history.replaceState(null, "", this.hash());
    this.update();
  }

  private update(): void {
    const { player } = this;
    const { index, place } = player;
    const time = place.until ?? player.shown?.moment.feedback?.arrived ?? timeOf(index, place.event);
    setText(
      this.when,
      `${elapsed((time - index.started) / 1e6)} of ${elapsed((index.ended - index.started) / 1e6)}`,
    );
    this.marks.update(index, time);
    this.timeline.update({ index, event: place.event, marks: this.marks.shown, loop: player.loop });
    this.transport.update();
    this.gauge?.update(performance.now());
    setData(this.element, "loading", String(player.isLoading));
    const words = this.troubleNow();
    setHidden(this.trouble, words === "");
    setText(this.trouble, words);
    const { damaged } = player.troubles;
    setHidden(this.damage, damaged === 0);
    setText(this.damage, `${damaged} damaged part${damaged === 1 ? "" : "s"}`);
  }

  private troubleNow(): string {
    const { trouble, index, isGone, isRunning } = this.player;
    if (isGone)
      return "This recording was deleted. You can still look at the parts that the page has loaded.";
    if (isRunning && trouble instanceof ConsoleError && trouble.status === 0)
      return "The console does not answer. The page keeps trying.";
    if (trouble !== null) return requestErrorLabel(trouble);
    return index.lastEvent === 0 ? "No part of this recording is on disk yet." : "";
  }

  private hash(): string {
    return replayHash({
      token: this.token,
      recording: this.details.entry.id,
      event: this.player.place.event,
    });
  }

  /** An observer's own link may go on; who may do more gives no rights away with it. */
  private async copyLink(told: HTMLElement): Promise<void> {
    const watches = roleOf(this.token) === "observer";
    const hash = replayHash({
      token: watches ? this.token : "",
      recording: this.details.entry.id,
      event: this.player.place.event,
    });
    try {
      await navigator.clipboard.writeText(`${location.origin}${location.pathname}${hash}`);
      setText(
        told,
        watches ? "Copied" : "Copied, without your rights: others open the recording with their own link",
      );
    } catch {
      setText(told, "The address of this page is the link");
    }
  }

  private async download(): Promise<void> {
    try {
      await downloadRecording(this.api, this.details.entry.id);
    } catch (error) {
      this.player.trouble = error;
      this.update();
    }
  }
}

/** What the robot and its people were doing. */
function stateWords({ moment }: ShownMoment): string {
  const { feedback, command, driver } = moment;
  if (feedback === null)
    return moment.damaged
      ? "This part of the recording is damaged"
      : "No feedback of this event was recorded";
  const parts = [];
  if (feedback.stopped) parts.push(`Stopped${feedback.stopBy === "" ? "" : ` by ${feedback.stopBy}`}`);
  else parts.push(feedback.atRest ? "At rest" : "Moving");
  if (command !== null && command.name !== "") parts.push(`commanded by ${command.name}`);
  else if (driver !== null && driver !== "") parts.push(`${driver} drives`);
  if (feedback.issue > 1) parts.push(`measured ${feedback.issue} times`);
  return [...parts, ...feedback.limits, ...feedback.faults].join(" · ");
}

function createCameraView(name: string, label: string): CameraView {
  const canvas = h("canvas", "picture", { "data-stream": name, width: "1", height: "1" });
  const stampWords = h("span", "view-stamp");
  const words = h("p", "replay-empty");
  const caption = h("figcaption", "view-caption", {}, h("span", "view-label", {}, label), stampWords);
  const drawing = canvas.getContext("2d", { willReadFrequently: false });
  return {
    element: h("figure", "view replay-view", {}, canvas, words, caption),
    show(picture, stamp, event, trouble, paint) {
      setHidden(words, picture !== undefined);
      setText(words, trouble);
      canvas.classList.toggle("is-blank", picture === undefined);
      const gap = stamp === null ? 0 : eventGap(event, stamp);
      setText(stampWords, stamp === null ? "" : `s ${grouped(stamp)}${gap > 0 ? ` · ${gap} behind` : ""}`);
      if (picture === undefined) return;
      const { displayWidth: width, displayHeight: height } = picture;
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      if (drawing === null) return;
      drawing.drawImage(picture, 0, 0, width, height);
      paint(drawing);
    },
  };
}

import { holdsSeat, note, type ConsoleState } from "../session/console_state";
import { drivingKeys } from "../input/shortcuts";
import {
  createPushToTalk,
  microphoneAnswered,
  stepTalk,
  type MicrophoneState,
  type TalkAction,
} from "./push_to_talk";
import { Disposal } from "../input/disposal";
import { watchPage } from "../input/page_lifecycle";
import { Microphone } from "./microphone";

export const TALK_KEY = "KeyV";

const ANSWER_WORDS: Readonly<Record<string, string>> = {
  missing: "No microphone was found: nobody can hear you",
  refused: "The microphone was not allowed: nobody can hear you. The browser's site settings can change that",
};

/** What talking depends on. */
export interface TalkbackContext {
  readonly state: ConsoleState;
  readonly controls: { readonly keyboard: { readonly keys: ReadonlySet<string> } };
  readonly page: { isOccupied(): boolean }; // a text field has the keyboard, or something stands over the pictures
  readonly audio: { open(): AudioContext };
  readonly display: { readonly visible: boolean }; // whether the person sees the page
  hears(now: number): boolean; // the console has spoken lately
}

/** Push to talk: the voice of who holds the seat is heard at the robot while the button or its key is held. */
export class Talkback {
  readonly talk = createPushToTalk();
  private readonly voice = new Microphone();
  private readonly disposal = new Disposal();
  private sender: RTCRtpSender | null = null;
  private isPressed = false; // the button

  constructor(private readonly context: TalkbackContext) {
    watchPage(this.disposal, {
      blurred: () => this.letGo(),
      left: () => this.letGo(),
      visibilityChanged: () => {
        if (!this.context.display.visible) this.letGo();
      },
      networkChanged: () => undefined,
    });
  }

  /** Whether the console takes a voice from this connection. */
  isOffered(): boolean {
    return this.sender !== null;
  }

  /** Why nothing can be said now, in words; null when it can. */
  obstacle(): string | null {
    if (this.sender === null) return "There is no loudspeaker at the robot";
    if (!this.context.hears(performance.now())) return "The console is silent";
    if (!holdsSeat(this.context.state)) return "Only the driver is heard at the robot";
    const trouble = this.context.state.voice?.trouble ?? "";
    return trouble === "" ? null : `The loudspeaker at the robot does not work (${trouble})`;
  }

  /** Whether the key drives this robot and therefore does not talk while armed. */
  keyDrives(): boolean {
    return drivingKeys(this.context.state.robot?.description ?? null).has(TALK_KEY);
  }

  level(): number {
    return this.talk.talking ? this.voice.level() : 0;
  }

  attach(sender: RTCRtpSender | null): void {
    this.sender = sender;
  }

  /** The connection has gone. */
  detach(): void {
    this.letGo();
    this.sender = null;
  }

  press(): void {
    this.isPressed = true;
    this.step(performance.now());
  }

  release(): void {
    this.isPressed = false;
    this.step(performance.now());
  }

  /** Silence now; what is still held talks again only after it was let go. */
  letGo(): void {
    this.isPressed = false;
    this.talk.spent = true;
    this.step(performance.now(), true);
  }

  step(now: number, gone = false): void {
    const { keyboard } = this.context.controls;
    const byKey = keyboard.keys.has(TALK_KEY) && !this.context.page.isOccupied() && !this.keyDrives();
    const blocked = gone || !this.context.display.visible || this.voice.isLost() || this.obstacle() !== null;
    this.act(stepTalk(this.talk, this.isPressed || byKey, blocked, now));
    if (this.voice.isLost() && !this.talk.talking) this.shut();
  }

  close(): void {
    this.letGo();
    this.disposal.close();
    this.voice.shut();
  }

  private act(action: TalkAction | null): void {
    if (action === "open") void this.open();
    else if (action === "start" && this.sender !== null) this.voice.start(this.sender);
    else if (action === "stop") this.voice.stop(this.sender);
    else if (action === "shut") this.voice.shut();
  }

  private async open(): Promise<void> {
    let answer: MicrophoneState = "open";
    try {
      await this.voice.open(this.context.audio.open());
    } catch (error) {
      answer = error instanceof DOMException && error.name === "NotAllowedError" ? "refused" : "missing";
    }
    microphoneAnswered(this.talk, answer, performance.now());
    const words = ANSWER_WORDS[answer];
    if (words !== undefined) note(this.context.state, "warning", words, Date.now());
  }

  private shut(): void {
    this.voice.shut();
    this.talk.microphone = "shut";
  }
}

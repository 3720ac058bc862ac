import type { Action, ActionUpdate, ClientMessage } from "../protocol/wire";

/** Without an answer for so long a request counts as lost: the robot takes none that is older. */
const ANSWER_MS = 3000;

interface Asked {
  readonly id: string;
  readonly atMs: number;
  answered: boolean;
}

/** What this page asks of the robot, and which action its armed commands let go on. */
export class ActionClient {
  private moving: Asked | null = null;

  /** `draw`: 16 random bytes in hex. */
  constructor(
    private readonly tell: (message: ClientMessage) => boolean,
    private readonly draw: () => string,
  ) {}

  /** Asks once. Says whether the request left. */
  act(
    action: Action,
    parameters: Readonly<Record<string, boolean | number | string>>,
    nonce: number,
    now: number,
  ): boolean {
    // A second click before the answer would take the first request's renewals.
    if (action.moves && this.renewed(now) !== "") return false;
    const id = this.draw();
    if (!this.tell({ type: "act", id, name: action.name, parameters, nonce })) return false;
    if (action.moves) this.moving = { id, atMs: now, answered: false };
    return true;
  }

  /** "" cancels what moves the robot. */
  cancel(id: string): void {
    this.tell({ type: "action_cancel", id });
    if (this.moving?.id === id || id === "") this.moving = null;
  }

  updated(update: ActionUpdate): void {
    if (this.moving?.id !== update.id) return;
    if (update.state === "running") this.moving.answered = true;
    else this.moving = null;
  }

  /** Disarmed, or another connection: nothing of this page lets it go on. */
  forget(): void {
    this.moving = null;
  }

  /** The id that armed commands name now; "" for none. */
  renewed(now: number): string {
    const { moving } = this;
    if (moving === null) return "";
    if (!moving.answered && now - moving.atMs > ANSWER_MS) this.moving = null;
    return this.moving?.id ?? "";
  }
}

/** 16 random bytes in hex. */
export function drawId(): string {
  return [...crypto.getRandomValues(new Uint8Array(16))]
    .map((byte) => byte.toString(16).padStart(2, "0"))
    .join("");
}

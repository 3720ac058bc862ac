import { holdsSeat, mayDrive, policyDrives, type ConsoleState } from "./console_state";
import { claimsAfter, idleSecondsAfter, type Claim, type Role } from "./seat/seat_status";
import type { ClientMessage, Welcome } from "../protocol/wire";

const NAME_LIMIT = 60; // characters, as the console takes them
const NOTE_LIMIT = 500;
const NAME_KEY = "lockstep.name";

/** What this page says to the other people: about the seat, its name, notes. */
export class SessionClient {
  role: Role | null = null; // of the last connection: the link has one and keeps it
  private wantsSeat = true; // when it connects
  shownClaim: string | null = null; // the peer whose request stands on the page now
  seatMs = 0; // when the console last spoke of the seat: its countdowns began then

  constructor(
    private readonly state: ConsoleState,
    private name: string | null, // wanted; null: the link's own
    private readonly tell: (message: ClientMessage) => boolean,
  ) {
    this.name = storedName() ?? name;
  }

  /** An operator's page takes the seat if nobody has it, unless it gave it away, and disturbs nobody otherwise. */
  welcomed(welcome: Welcome): void {
    this.role = welcome.role;
    if (this.name !== null) this.tell({ type: "rename", name: this.name });
    if (welcome.role === "operator" && this.wantsSeat)
      this.tell({ type: "seat_request", only_if_free: true });
  }

  /** A network that failed took the seat, not a person: back again, it is asked for unless somebody else has it. */
  lostSeat(): void {
    const { seat } = this.state;
    this.wantsSeat = seat?.why === "heartbeat lost" || seat?.why === "disconnected";
    if (seat?.holder === "" && seat.why === "heartbeat lost")
      this.tell({ type: "seat_request", only_if_free: true });
  }

  requestSeat(): void {
    this.wantsSeat = true;
    this.tell({ type: "seat_request" });
  }

  /** The holder shows that somebody is there. */
  keepSeat(): void {
    if (holdsSeat(this.state)) this.tell({ type: "seat_request" });
  }

  takeSeat(): void {
    this.wantsSeat = true;
    this.tell({ type: "seat_take" });
  }

  /** One press of a person ends the turn of the policy that drives. Says whether one does. */
  takeOver(): boolean {
    if (!policyDrives(this.state) || !mayDrive(this.state)) return false;
    this.takeSeat();
    return true;
  }

  release(): void {
    this.tell({ type: "seat_release" });
  }

  answer(peer: string, grant: boolean): void {
    this.tell({ type: grant ? "seat_grant" : "seat_decline", peer });
  }

  /**
   * Answers whoever stands on the page, and nobody who came in their place since it was drawn: the robot is handed to
   * who was read. Says whether this page asks its person at all.
   */
  answerShown(grant: boolean): boolean {
    const { shownClaim, state } = this;
    if (grant && this.takeOver()) return true;
    if (shownClaim === null || !holdsSeat(state)) return false;
    if (state.seat?.claims.some((each) => each.peer === shownClaim) === true) this.answer(shownClaim, grant);
    return true;
  }

  /** A supervisor's: whether STOP from that peer's link has an effect. */
  silence(peer: string, silent: boolean): void {
    this.tell({ type: "silence_stops", peer, silent });
  }

  claims(now: number): Claim[] {
    return claimsAfter(this.state.seat, now - this.seatMs);
  }

  idleSecondsLeft(now: number): number | null {
    return idleSecondsAfter(this.state.seat, now - this.seatMs);
  }

  /** The name lasts as long as the tab. */
  rename(wanted: string): void {
    const name = wanted.trim().slice(0, NAME_LIMIT);
    if (name === "") return;
    this.name = name;
    storeName(name);
    this.tell({ type: "rename", name });
  }

  /** Says whether the note left. */
  writeNote(text: string): boolean {
    const note = text.trim().slice(0, NOTE_LIMIT);
    return note !== "" && this.tell({ type: "note", text: note });
  }
}

/** A browser may refuse storage; the name then lasts as long as the page. */
function storedName(): string | null {
  try {
    return sessionStorage.getItem(NAME_KEY);
  } catch {
    return null;
  }
}

function storeName(name: string): void {
  try {
    sessionStorage.setItem(NAME_KEY, name);
  } catch {
    return;
  }
}

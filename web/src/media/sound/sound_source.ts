import type { GateContext } from "../../gate/gate_counters";

/** Where the sound of one stream comes from. */
export interface SoundSource {
  readonly node: AudioNode;
  /** RTP timestamp of what plays; undefined while nothing does. */
  playing(): number | undefined;
  /** Ms of sound that arrived and waits behind `playing`. */
  waiting(playing: number): number;
  /** What is judged against now. */
  tell(context: GateContext): void;
  /** Works off what waits too long. `isTooOld`: what plays does not pass. */
  catchUp(playing: number, isTooOld: boolean): void;
  /** Whether sound is being left out so that it catches up. */
  leavesOut(): boolean;
  close(): void;
}

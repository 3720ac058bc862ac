/** Where the sound of one stream comes from. */
export interface SoundSource {
  readonly node: AudioNode;
  /** RTP timestamp of what plays; undefined while nothing does. */
  playing(): number | undefined;
  /** Ms of sound that arrived and waits behind `playing`. */
  waiting(playing: number): number;
  /** Works off what waits too long. `isTooOld`: what plays does not pass; `passes`: whether another packet would. */
  catchUp(playing: number, isTooOld: boolean, passes: (rtpTimestamp: number) => boolean): void;
  /** What plays is as old as the tolerance allows. */
  hurry(): void;
  /** Whether sound is being left out so that it catches up. */
  leavesOut(): boolean;
  close(): void;
}

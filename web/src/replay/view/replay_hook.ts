import { CAMERA, MICROPHONE } from "../chunk";
import type { ReplayMoment } from "../moment";
import type { PlayerView } from "./player_view";

/** What the page says of itself to tests: `window.lockstep`, as on the console's page. */
export function installReplayHook(view: PlayerView | null): void {
  Object.assign(window, {
    lockstep: {
      rendered: (name: string) => view?.rendered.get(name) ?? [],
      picture: (name: string) => hex(momentOf(view)?.pictures.get(CAMERA + name)?.record.payload),
      sound: (name: string) =>
        momentOf(view)
          ?.sounds.get(MICROPHONE + name)
          ?.packets.map((each) => hex(each.payload)) ?? [],
      stats: () => (view === null ? null : statsOf(view)),
    },
  });
}

function momentOf(view: PlayerView | null): ReplayMoment | undefined {
  return view?.player.shown?.moment;
}

/** As it was recorded, before it is decoded. */
function hex(payload: Uint8Array | undefined): string {
  return Array.from(payload ?? [], (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function statsOf({ player, sounds, scene }: PlayerView): object {
  const { shown, place, isLoading, isPlaying, index } = player;
  const moment = shown?.moment;
  return {
    wanted: place.event,
    event: moment?.place.event ?? null,
    ready: !isLoading && moment?.place === place,
    playing: isPlaying,
    running: player.isRunning,
    first_event: index.firstEvent,
    last_event: index.lastEvent,
    ended: index.ended,
    command: moment?.command ?? null,
    feedback: moment?.feedback ?? null,
    scene: scene?.statistics() ?? null,
    unreadable: player.troubles,
    deleted: player.isGone,
    troubles: Object.fromEntries(shown?.troubles ?? []),
    pictures: Object.fromEntries(
      [...(moment?.pictures ?? [])].map(([topic, { record }]) => [topic.slice(CAMERA.length), record.event]),
    ),
    sounds: Object.fromEntries(
      [...(moment?.sounds ?? [])].map(([topic, { packets }]) => [
        topic.slice(MICROPHONE.length),
        {
          stamps: packets.map((each) => each.event),
          sizes: packets.map((each) => each.payload.length),
          level: sounds.levels.get(topic) ?? null,
        },
      ]),
    ),
  };
}

import type { ConsoleEngine } from "../engine/console_engine";
import { note } from "../session/console_state";
import type { ConsoleApi } from "../transport/signalling/console_api";
import type { ViewGrid } from "../ui/views/view_grid";
import type { MapView } from "./map_view";

const KEY = "lockstep.map";
const NAME = "Map";

/** Whether the map stands on the page: as the person has decided. Its code comes when it is first wanted. */
export class MapSwitch {
  isOn = false;
  private view: MapView | null = null;
  private loads = false;
  private isKeptOn = keptChoice(); // until the robot says whether it has a map

  constructor(
    private readonly engine: ConsoleEngine,
    private readonly grid: ViewGrid,
    private readonly api: ConsoleApi,
    private readonly redraw: () => void,
  ) {}

  /** The person's own decision, which is kept. */
  toggle(): void {
    this.isKeptOn = false;
    try {
      localStorage.setItem(KEY, this.isOn ? "hidden" : "shown");
    } catch {
      // storage is switched off: it holds until the page closes
    }
    this.show(!this.isOn);
  }

  update(now: number): void {
    const { robot } = this.engine.state;
    if (robot !== null) {
      const hasMap = robot.description.map !== null;
      if (this.isOn && !hasMap) this.show(false);
      if (this.isKeptOn && hasMap) {
        this.isKeptOn = false;
        this.show(true);
      }
    }
    if (this.isOn) this.view?.update(now);
  }

  private show(on: boolean): void {
    if (on === this.isOn || this.loads) return;
    if (this.view === null) {
      this.load();
      return;
    }
    this.isOn = on;
    this.view.cancelGesture();
    this.grid.toggleView(NAME, this.view.element);
    this.redraw();
  }

  private load(): void {
    this.loads = true;
    import("./map_view").then(
      ({ MapView }) => {
        this.loads = false;
        this.view = new MapView(this.engine, this.api);
        this.show(true);
      },
      () => {
        this.loads = false;
        note(this.engine.state, "error", "The map could not be loaded", Date.now());
      },
    );
  }
}

function keptChoice(): boolean {
  try {
    return localStorage.getItem(KEY) === "shown";
  } catch {
    return false;
  }
}

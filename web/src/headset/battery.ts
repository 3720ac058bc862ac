/** Where the browser tells of it (Battery Status API; not in TypeScript's library). */
interface BatteryManager extends EventTarget {
  readonly charging: boolean;
  readonly level: number; // 0 to 1
}

const LOW = 0.05;

/** The battery of the machine that the browser runs on, which is the headset where that has a browser of its own. */
export class Battery {
  level: number | null = null; // null: not known
  private manager: BatteryManager | null = null;
  private isClosed = false;
  private isLow = false;

  /** `low`: it became almost empty and is not charged. */
  constructor(private readonly low: () => void) {
    const { getBattery } = navigator as { getBattery?: () => Promise<BatteryManager> };
    getBattery?.call(navigator).then(
      (manager) => this.watch(manager),
      () => undefined, // it is refused: the level stays unknown
    );
  }

  close(): void {
    this.isClosed = true;
    for (const type of ["levelchange", "chargingchange"]) this.manager?.removeEventListener(type, this.look);
  }

  private watch(manager: BatteryManager): void {
    if (this.isClosed) return;
    this.manager = manager;
    for (const type of ["levelchange", "chargingchange"]) manager.addEventListener(type, this.look);
    this.look();
  }

  private readonly look = (): void => {
    if (this.manager === null) return;
    this.level = this.manager.level;
    const isLow = this.manager.level <= LOW && !this.manager.charging;
    if (isLow && !this.isLow) this.low();
    this.isLow = isLow;
  };
}

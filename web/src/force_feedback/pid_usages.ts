/** Usage page 0x0F: USB Device Class Definition for Physical Interface Devices 1.0, and HID Usage Tables, "Physical Input Device". */
const pid = (usage: number): number => 0x0f_0000 + usage;

export const PID_PAGE = 0x0f;

/** Usages of the collections that hold one report each. */
export const REPORTS = {
  setEffect: pid(0x21),
  setCondition: pid(0x5f),
  setConstantForce: pid(0x73),
  effectOperation: pid(0x77),
  deviceGain: pid(0x7d),
  pool: pid(0x7f),
  blockLoad: pid(0x89),
  blockFree: pid(0x90),
  deviceControl: pid(0x96),
  createNewEffect: pid(0xab),
} as const;

/** Collections inside of a report. */
export const AXES_ENABLE = pid(0x55);
export const DIRECTION = pid(0x57);

export const X = 0x01_0030; // Generic Desktop
export const Y = 0x01_0031;
export const FIRST_ORDINAL = 0x0a_0001; // of Direction

export const EFFECT_BLOCK_INDEX = pid(0x22);
export const PARAMETER_BLOCK_OFFSET = pid(0x23);
export const DURATION = pid(0x50);
export const GAIN = pid(0x52);
export const TRIGGER_BUTTON = pid(0x53);
export const DIRECTION_ENABLE = pid(0x56);
export const POSITIVE_COEFFICIENT = pid(0x61);
export const NEGATIVE_COEFFICIENT = pid(0x62);
export const POSITIVE_SATURATION = pid(0x63);
export const NEGATIVE_SATURATION = pid(0x64);
export const MAGNITUDE = pid(0x70);
export const LOOP_COUNT = pid(0x7c);
export const DEVICE_GAIN = pid(0x7e);
export const DEVICE_MANAGED_POOL = pid(0xa9);

export const EFFECT_TYPES = { constant: pid(0x26), spring: pid(0x40), damper: pid(0x41) } as const;
export type EffectKind = keyof typeof EFFECT_TYPES;

export const OPERATIONS = { start: pid(0x79), stop: pid(0x7b) } as const;
export type EffectOperation = keyof typeof OPERATIONS;

export const CONTROLS = {
  enableActuators: pid(0x97),
  stopAllEffects: pid(0x99),
  reset: pid(0x9a),
} as const;
export type DeviceControl = keyof typeof CONTROLS;

export const LOAD_SUCCESS = pid(0x8c);
export const LOAD_FULL = pid(0x8d);
export const LOAD_ERROR = pid(0x8e);

// A force-feedback joystick that is a fake, and a navigator.hid to find it with: window.testStick.
//
// It was written from the USB Device Class Definition for Physical Interface Devices 1.0 and HID 1.11: it has a report
// descriptor, from which its collections are made as Chromium makes them, and reads its reports by places that are
// written down here by hand. It pushes nobody. What a real stick does with the same reports was not tried.
(() => {
  const u16 = (value) => [value & 0xff, (value >> 8) & 0xff];
  const page = (value) => [0x05, value];
  const usage = (value) => [0x09, value];
  const collection = (kind, ...items) => [0xa1, kind, ...items.flat(), 0xc0];
  const logical = (least, most) => [0x16, ...u16(least), 0x26, ...u16(most)];
  const physical = (least, most) => [0x36, ...u16(least), 0x46, ...u16(most)];
  const unit = (value, exponent) => [0x66, ...u16(value), 0x55, exponent & 0x0f];
  const bits = (size, count) => [0x75, size, 0x95, count];
  const VARIABLE = 0x02;
  const ARRAY = 0x00;
  const PADDING = 0x03;
  const input = (flags) => [0x81, flags];
  const output = (flags) => [0x91, flags];
  const feature = (flags) => [0xb1, flags];
  const id = (value) => [0x85, value];
  const noUnit = [...unit(0, 0), ...physical(0, 0)];
  const block = (main) => [page(0x0f), usage(0x22), logical(1, 10), physical(0, 0), bits(8, 1), main(VARIABLE)].flat();
  const list = (name, members, main) =>
    [page(0x0f), usage(name), collection(2, ...members.map(usage), logical(1, members.length), bits(8, 1), main(ARRAY))].flat();
  const seconds = [...unit(0x1003, -3), ...logical(0, 32767), ...physical(0, 32767), ...bits(16, 1)];
  const share = (least, most, size) => [noUnit, logical(least, most), bits(size, 1)].flat();
  const TYPES = [0x26, 0x40, 0x41]; // constant force, spring, damper
  const CONTROLS = [0x97, 0x98, 0x99, 0x9a, 0x9b, 0x9c];

  const setEffect = [
    ...id(1),
    ...block(output),
    ...list(0x25, TYPES, output),
    ...[usage(0x50), usage(0x54), seconds, bits(16, 2), output(VARIABLE)].flat(),
    ...[usage(0x52), share(0, 255, 8), output(VARIABLE)].flat(),
    ...[usage(0x53), logical(1, 8), bits(8, 1), output(VARIABLE)].flat(),
    ...[usage(0x55), collection(2, page(0x01), usage(0x30), usage(0x31), logical(0, 1), bits(1, 2), output(VARIABLE))].flat(),
    ...[page(0x0f), usage(0x56), bits(1, 1), output(VARIABLE), bits(5, 1), output(PADDING)].flat(),
    ...[usage(0x57), collection(2, page(0x0a), usage(1), usage(2), unit(0x14, 0), logical(0, 255), physical(0, 360), bits(8, 2), output(VARIABLE))].flat(),
    ...[page(0x0f), noUnit, usage(0x58), collection(2, page(0x0a), usage(1), usage(2), logical(0, 255), bits(8, 2), output(VARIABLE))].flat(),
  ];
  const setCondition = [
    ...id(3),
    ...block(output),
    ...[usage(0x23), logical(0, 1), bits(4, 1), output(VARIABLE), bits(4, 1), output(PADDING)].flat(),
    ...[usage(0x60), usage(0x61), usage(0x62), logical(-128, 127), bits(8, 3), output(VARIABLE)].flat(),
    ...[usage(0x63), usage(0x64), usage(0x65), logical(0, 255), bits(8, 3), output(VARIABLE)].flat(),
  ];
  const DESCRIPTOR = [
    ...[page(0x01), usage(0x04)].flat(),
    ...collection(
      1,
      ...[id(1), page(0x01), usage(0x30), usage(0x31), logical(-512, 511), bits(16, 2), input(VARIABLE)],
      ...[page(0x09), [0x19, 1, 0x29, 8], logical(0, 1), bits(1, 8), input(VARIABLE)],
      ...[page(0x0f), usage(0x21), collection(2, setEffect)],
      ...[page(0x0f), usage(0x5f), collection(2, setCondition)],
      ...[page(0x0f), usage(0x73), collection(2, id(5), block(output), usage(0x70), share(-255, 255, 16), output(VARIABLE))],
      ...[page(0x0f), usage(0x77), collection(2, id(10), block(output), list(0x78, [0x79, 0x7a, 0x7b], output), usage(0x7c), share(0, 255, 8), output(VARIABLE))],
      ...[page(0x0f), usage(0x96), collection(2, id(12), CONTROLS.map(usage).flat(), logical(1, 6), bits(8, 1), output(ARRAY))],
      ...[page(0x0f), usage(0x7d), collection(2, id(13), usage(0x7e), share(0, 255, 8), output(VARIABLE))],
      ...[page(0x0f), usage(0xab), collection(2, id(5), list(0x25, TYPES, feature), page(0x01), usage(0x3b), logical(0, 511), bits(10, 1), feature(VARIABLE), bits(6, 1), feature(PADDING))],
      ...[page(0x0f), usage(0x89), collection(2, id(6), block(feature), list(0x8b, [0x8c, 0x8d, 0x8e], feature), usage(0xac), logical(0, 32767), bits(16, 1), feature(VARIABLE))],
      ...[page(0x0f), usage(0x7f), collection(2, id(7), usage(0x80), logical(0, 32767), bits(16, 1), feature(VARIABLE), usage(0x83), logical(0, 127), bits(8, 1), feature(VARIABLE), usage(0xa9), usage(0xaa), logical(0, 1), bits(1, 2), feature(VARIABLE), bits(6, 1), feature(PADDING))],
    ),
  ];

  const KINDS = { 0x80: "inputReports", 0x90: "outputReports", 0xb0: "featureReports" };

  /** The collections that a browser shows of a report descriptor: an item is in its collection and in all around it. */
  function collectionsOf(bytes) {
    const top = [];
    const open = [];
    let globals = { page: 0, least: 0, most: 0, low: 0, high: 0, exponent: 0, size: 0, count: 0, id: 0 };
    let usages = [];
    let range = [0, 0];
    const signed = (value, size) => (value >= 2 ** (8 * size - 1) ? value - 2 ** (8 * size) : value);
    for (let at = 0; at < bytes.length; ) {
      const prefix = bytes[at];
      const size = [0, 1, 2, 4][prefix & 3];
      let value = 0;
      for (let each = 0; each < size; each += 1) value += bytes[at + 1 + each] * 256 ** each;
      at += 1 + size;
      const tag = prefix & 0xfc;
      if (tag === 0x04) globals.page = value;
      else if (tag === 0x14) globals.least = signed(value, size);
      else if (tag === 0x24) globals.most = signed(value, size);
      else if (tag === 0x34) globals.low = signed(value, size);
      else if (tag === 0x44) globals.high = signed(value, size);
      else if (tag === 0x54) globals.exponent = value > 7 ? value - 16 : value;
      else if (tag === 0x74) globals.size = value;
      else if (tag === 0x94) globals.count = value;
      else if (tag === 0x84) globals.id = value;
      else if (tag === 0x08) usages.push(globals.page * 0x10000 + value);
      else if (tag === 0x18) range[0] = globals.page * 0x10000 + value;
      else if (tag === 0x28) range[1] = globals.page * 0x10000 + value;
      else if (tag === 0xa0) {
        const made = { usagePage: globals.page, usage: (usages[0] ?? 0) & 0xffff, type: value, children: [] };
        Object.assign(made, { inputReports: [], outputReports: [], featureReports: [] });
        (open.at(-1)?.children ?? top).push(made);
        open.push(made);
      } else if (tag === 0xc0) open.pop();
      else if (tag in KINDS)
        for (const each of open) {
          const reports = each[KINDS[tag]];
          let report = reports.find((one) => one.reportId === globals.id);
          if (report === undefined) reports.push((report = { reportId: globals.id, items: [] }));
          report.items.push({
            isConstant: (value & 1) === 1,
            isArray: (value & 2) === 0,
            isRange: range[1] > 0,
            usages: [...usages],
            usageMinimum: range[0],
            usageMaximum: range[1],
            reportSize: globals.size,
            reportCount: globals.count,
            unitExponent: globals.exponent,
            logicalMinimum: globals.least,
            logicalMaximum: globals.most,
            physicalMinimum: globals.low,
            physicalMaximum: globals.high,
          });
        }
      if (tag in KINDS || tag === 0xa0 || tag === 0xc0) [usages, range] = [[], [0, 0]];
    }
    return top;
  }

  const s16 = (data, at) => new DataView(data.buffer, data.byteOffset).getInt16(at, true);
  const s8 = (data, at) => new DataView(data.buffer, data.byteOffset).getInt8(at);
  const LENGTHS = { 1: 13, 3: 8, 5: 3, 10: 3, 12: 1, 13: 1 };

  /** The stick: what its effects do at a time goes by the reports that it was sent. */
  class ForceStickFake {
    constructor(now = () => performance.now(), collections = collectionsOf(DESCRIPTOR)) {
      Object.assign(this, { now, collections, productName: "Fake force stick", vendorId: 0x045e, productId: 0x001b });
      this.opened = false;
      this.plugged = true;
      this.room = 10; // effects
      this.managesPool = true;
      this.sent = []; // [time, report id, bytes]
      this.trouble = []; // what the standard does not allow
      this.reset();
      this.actuators = false;
    }

    reset() {
      this.effects = new Map(); // by block
      this.loaded = null;
    }

    async open() {
      this.need();
      this.opened = true;
    }

    async close() {
      this.opened = false;
    }

    need() {
      if (!this.plugged) throw new DOMException("The device was disconnected", "NetworkError");
    }

    async sendReport(id, data) {
      this.need();
      if (!this.opened) throw new DOMException("The device is not open", "InvalidStateError");
      const now = this.now();
      this.sent.push([now, id, [...data]]);
      if (data.length !== LENGTHS[id]) this.trouble.push(`report ${id} of ${data.length} bytes`);
      else if (id === 12) this.control(data[0]);
      else if (id === 13) this.gain = data[0];
      else this.take(id, data, now);
    }

    control(control) {
      if (control === 1) this.actuators = true;
      else if (control === 2) this.actuators = false;
      else if (control === 3) for (const effect of this.effects.values()) effect.until = 0;
      else if (control === 4) this.reset();
    }

    take(id, data, now) {
      const effect = this.effects.get(data[0]);
      if (effect === undefined) {
        this.trouble.push(`report ${id} of block ${data[0]}, which was not made`);
        return;
      }
      if (id === 1) {
        if (data[1] !== effect.type) this.trouble.push(`block ${data[0]} is of type ${effect.type}, not ${data[1]}`);
        if (data[7] >= 1 && data[7] <= 8) this.trouble.push(`plays by button ${data[7]}`);
        effect.seconds = (data[2] + 256 * data[3]) / 1000;
        effect.gain = data[6] / 255;
        Object.assign(effect, { axes: data[8] & 3, polar: (data[8] & 4) !== 0, degrees: (data[9] * 360) / 255 });
      } else if (id === 3) effect.conditions[data[1] & 15] = { positive: s8(data, 3), negative: s8(data, 4), saturation: data[5] };
      else if (id === 5) effect.magnitude = s16(data, 1) / 255;
      else if (id === 10 && data[1] === 3) effect.until = 0;
      else if (id === 10) {
        if (!(effect.seconds > 0)) this.trouble.push(`block ${data[0]} starts without a duration`);
        effect.until = now + 1000 * effect.seconds * data[2];
      }
    }

    async sendFeatureReport(id, data) {
      this.need();
      if (id !== 5 || data.length !== 3) throw new DOMException("No such report", "NotAllowedError");
      const block = this.effects.size + 1;
      this.loaded = this.effects.size < this.room ? block : null;
      if (this.loaded !== null) this.effects.set(block, { type: data[0], conditions: [], until: 0, magnitude: 0 });
    }

    /** Chromium puts the report's id in front. */
    async receiveFeatureReport(id) {
      this.need();
      const answers = {
        6: this.loaded === null ? [6, 0, 2, 0, 0] : [6, this.loaded, 1, 0, 4],
        7: [7, 0, 8, 10, this.managesPool ? 1 : 0],
      };
      return new DataView(new Uint8Array(answers[id]).buffer);
    }

    /** What the hand feels: where the force pushes (right, ahead), of the stick's strongest, and what is a condition. */
    felt(now = this.now()) {
      const felt = { right: 0, ahead: 0, spring: 0, damper: 0 };
      if (!this.actuators || !this.opened) return felt;
      for (const effect of this.effects.values()) {
        if (effect.until <= now) continue;
        const angle = (effect.degrees * Math.PI) / 180; // of where it comes from
        const size = effect.magnitude * (effect.gain ?? 0);
        const [x, y] = effect.conditions;
        const isAlike = x !== undefined && x.positive === y?.positive && x.positive === x.negative;
        if (effect.type === 1 && effect.polar) {
          felt.right -= size * Math.sin(angle);
          felt.ahead -= size * Math.cos(angle);
        } else if (effect.type !== 1 && effect.axes === 3 && isAlike) {
          felt[effect.type === 2 ? "spring" : "damper"] = x.positive / 127;
        }
      }
      return felt;
    }

    /** When the last effect ends, if no report comes any more. */
    get until() {
      return Math.max(0, ...[...this.effects.values()].map((effect) => effect.until));
    }
  }

  /** A navigator.hid with one stick. The person chooses it whenever they are asked. */
  class HidFake {
    constructor(stick, granted = false) {
      Object.assign(this, { stick, granted, asked: [], listeners: { connect: [], disconnect: [] } });
    }

    async getDevices() {
      return this.granted && this.stick.plugged ? [this.stick] : [];
    }

    async requestDevice(options) {
      this.asked.push(options.filters);
      this.granted = this.stick.plugged;
      return this.getDevices();
    }

    addEventListener(kind, listener) {
      this.listeners[kind].push(listener);
    }

    plug(plugged) {
      Object.assign(this.stick, { plugged, opened: false });
      for (const listener of this.listeners[plugged ? "connect" : "disconnect"]) listener({ device: this.stick });
    }
  }

  Object.assign(globalThis, { ForceStickFake, HidFake, forceStickCollections: () => collectionsOf(DESCRIPTOR) });
  if (typeof document === "undefined") return;
  const stick = new ForceStickFake();
  const hid = new HidFake(stick, localStorage.getItem("lockstep.force") !== null);
  Object.defineProperty(navigator, "hid", { value: hid, configurable: true });
  globalThis.testStick = stick;
})();

// A gamepad of the W3C standard mapping that a test moves: window.testPad.
(() => {
  const button = () => ({ pressed: false, touched: false, value: 0 });
  const pad = {
    index: 0,
    id: "Test pad (STANDARD GAMEPAD Vendor: 0000 Product: 0000)",
    connected: true,
    mapping: "standard",
    timestamp: 0,
    axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, button),
    vibrationActuator: {
      type: "dual-rumble",
      effects: ["dual-rumble"],
      playEffect: (type, effect) => {
        window.testPad.rumbles.push(effect);
        return Promise.resolve("complete");
      },
      reset: () => Promise.resolve("complete"),
    },
  };
  window.testPad = {
    plugged: true,
    rumbles: [],
    press(index, pressed) {
      pad.buttons[index] = { pressed, touched: pressed, value: pressed ? 1 : 0 };
      pad.timestamp = performance.now();
    },
    tilt(axis, value) {
      pad.axes[axis] = value;
      pad.timestamp = performance.now();
    },
    unplug() {
      this.plugged = false;
      window.dispatchEvent(Object.assign(new Event("gamepaddisconnected"), { gamepad: pad }));
    },
  };
  navigator.getGamepads = () => (window.testPad.plugged ? [pad, null, null, null] : [null, null, null, null]);
})();

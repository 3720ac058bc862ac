// Gamepads that a test moves: window.testPad. One of the W3C standard mapping is plugged in from the start.
(() => {
  const button = () => ({ pressed: false, touched: false, value: 0 });
  const slots = [null, null, null, null];

  // `felt` gets every effect as it is played and null as it is stopped.
  const actuator = (index, effects) => ({
    type: "dual-rumble",
    effects,
    playEffect: (type, effect) => {
      if (!effects.includes(type)) return Promise.reject(new DOMException("no such effect", "NotSupportedError"));
      window.testPad.rumbles.push({ type, pad: index, noted: window.testPad.onplay?.(), ...effect });
      window.testPad.felt.push(type);
      return Promise.resolve("complete");
    },
    reset: () => {
      window.testPad.felt.push(null);
      return Promise.resolve("complete");
    },
  });

  window.testPad = {
    looks: 0, // of the page at its pads, so far
    onplay: undefined, // what it returns stays with the effect
    rumbles: [],
    felt: [],
    // Plugs in another pad; returns its index.
    plug({ id = "Test pad", mapping = "standard", axes = [0, 0, 0, 0], buttons = 17, effects = ["dual-rumble"] } = {}) {
      const index = slots.indexOf(null);
      slots[index] = {
        index,
        id,
        connected: true,
        mapping,
        timestamp: performance.now(),
        axes: [...axes],
        buttons: Array.from({ length: buttons }, button),
        vibrationActuator: actuator(index, effects),
      };
      window.dispatchEvent(Object.assign(new Event("gamepadconnected"), { gamepad: slots[index] }));
      return index;
    },
    press(at, pressed, index = 0) {
      slots[index].buttons[at] = { pressed, touched: pressed, value: pressed ? 1 : 0 };
      slots[index].timestamp = performance.now();
    },
    // A trigger, which is pulled by a share of its way.
    pull(at, value, index = 0) {
      slots[index].buttons[at] = { pressed: value > 0, touched: value > 0, value };
      slots[index].timestamp = performance.now();
    },
    tilt(axis, value, index = 0) {
      slots[index].axes[axis] = value;
      slots[index].timestamp = performance.now();
    },
    // Once the page has read its pads, also where a busy machine lets it do so late. It looks more than once for each
    // time that it reads, and not at all while it is held up.
    seen() {
      const { looks } = window.testPad;
      const end = performance.now() + 2000;
      return new Promise((resolve) => {
        const look = () => {
          if (window.testPad.looks >= looks + 6 || performance.now() > end) resolve();
          else setTimeout(look, 5);
        };
        look();
      });
    },
    unplug(index = 0) {
      const gamepad = slots[index];
      slots[index] = null;
      gamepad.connected = false;
      window.dispatchEvent(Object.assign(new Event("gamepaddisconnected"), { gamepad }));
    },
  };
  window.testPad.plug({ id: "Test pad (STANDARD GAMEPAD Vendor: 0000 Product: 0000)" });
  navigator.getGamepads = () => {
    window.testPad.looks++;
    return [...slots];
  };
})();

// Lets a test change or add what the console says: window.tamper(channel, message) returns what the page gets instead,
// null for nothing; window.say(channel, message) makes the page hear a message of the test's own.
(() => {
  const channels = new Map();
  window.tamper = (_, message) => message;
  window.say = (label, message) => channels.get(label)(new MessageEvent("message", { data: JSON.stringify(message) }));
  window.mute = null; // a kind of message that the page cannot send
  window.sent = []; // all others that it has sent
  const { send } = RTCDataChannel.prototype;
  RTCDataChannel.prototype.send = function (text) {
    const message = JSON.parse(text);
    if (message.type === window.mute) return;
    window.sent.push(message);
    send.call(this, text);
  };
  const { createDataChannel } = RTCPeerConnection.prototype;
  RTCPeerConnection.prototype.createDataChannel = function (label, options) {
    const channel = createDataChannel.call(this, label, options);
    Object.defineProperty(channel, "onmessage", {
      set(handler) {
        channels.set(label, handler);
        channel.addEventListener("message", (event) => {
          const message = window.tamper(label, JSON.parse(event.data));
          if (message !== null) handler(new MessageEvent("message", { data: JSON.stringify(message) }));
        });
      },
    });
    return channel;
  };
})();

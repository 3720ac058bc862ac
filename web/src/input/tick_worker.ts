/** A timer that goes on at its rate while the page is hidden. */
const scope = self as unknown as { postMessage(message: null): void };

setInterval(() => scope.postMessage(null), 10);

/** A timer that goes on at its rate while the page is hidden. A message is its new interval in ms. */
interface Scope {
  postMessage(message: null): void;
  onmessage: ((event: MessageEvent<number>) => void) | null;
}

const scope = self as unknown as Scope;
let timer = every(10);

scope.onmessage = ({ data }) => {
  clearInterval(timer);
  timer = every(data);
};

function every(ms: number): ReturnType<typeof setInterval> {
  return setInterval(() => scope.postMessage(null), ms);
}

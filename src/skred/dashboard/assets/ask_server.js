// Asks the server for a view: a question goes through one text of the session, its reply comes by another.
(function () {
  const waiting = new Map();
  let count = 0, connected = null;
  const tagged = (tag) => Bokeh.documents.flatMap((one) => [...one.all_models]).find((one) => one.tags.includes(tag));

  function session() {
    connected ??= new Promise((resolve, reject) => {
      const begun = Date.now();
      const look = () => {
        const question = tagged("skred-question"), reply = tagged("skred-reply");
        if (question && reply) {
          reply.properties.value.change.connect(() => {
            const answer = JSON.parse(reply.value), resolved = waiting.get(answer.id);
            waiting.delete(answer.id);
            if (resolved) resolved(answer);
          });
          resolve(question);
        } else if (Date.now() - begun > 30000) reject(new Error("no session; is the server still there?"));
        else setTimeout(look, 30);
      };
      look();
    });
    return connected;
  }

  window.skredAsk = async (key, parameters) => {
    const question = await session(), id = String(++count);
    return new Promise((resolve, reject) => {
      waiting.set(id, resolve);
      setTimeout(() => { if (waiting.delete(id)) reject(new Error("no reply within five minutes; is the server still there?")); }, 300000);
      question.value = JSON.stringify({ id, key, parameters });
    });
  };
})();

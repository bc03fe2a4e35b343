import { mount } from 'svelte';
import { Refused } from './api';
import App from './App.svelte';
import './app.css';
import { station } from './station.svelte';

// What the server refuses while something is fetched in the background.
window.addEventListener('unhandledrejection', (e) => {
  if (!(e.reason instanceof Refused)) return;
  e.preventDefault();
  station.complain(e.reason);
});
// The picture is on the screen before the page is built around it; where it is late, the page does not wait.
const longestWaitMs = 400;
void Promise.race([window.vssEarly?.shown, new Promise((done) => setTimeout(done, longestWaitMs))]).then(() => mount(App, { target: document.body }));

import { mount } from 'svelte';
import { fetchEarly, Refused } from './api';
import App from './App.svelte';
import './app.css';
import { lastImage, station } from './station.svelte';

// What the server refuses while something is fetched in the background.
window.addEventListener('unhandledrejection', (e) => {
  if (!(e.reason instanceof Refused)) return;
  e.preventDefault();
  station.complain(e.reason);
});
fetchEarly(lastImage());
mount(App, { target: document.body });

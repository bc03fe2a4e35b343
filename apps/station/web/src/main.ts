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
mount(App, { target: document.body });
